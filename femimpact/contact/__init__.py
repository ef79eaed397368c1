"""Contact of one scalar pair: when a ball touches, which wall, with what force, and how fast it rebounds."""

from femimpact.lazy import face

__getattr__, __dir__, __all__ = face(__name__, __file__)

"""What a run leaves: channels and history, impacts, the energy ledger, regimes."""

from femimpact.response.response import Channel, Recorder, Response

__all__ = ["Channel", "Recorder", "Response"]

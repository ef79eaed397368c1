"""Results of a run: channels and history, impacts, the energy ledger, regimes."""

from femimpact.response.channels import Channel
from femimpact.response.response import Recorder, Response

__all__ = ["Channel", "Recorder", "Response"]

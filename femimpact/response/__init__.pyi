from femimpact.response.cycles import Largest as Largest
from femimpact.response.energy import EnergyLedger as EnergyLedger
from femimpact.response.history import HistoryPiece as HistoryPiece
from femimpact.response.history import StroboscopicSection as StroboscopicSection
from femimpact.response.impacts import EventLog as EventLog
from femimpact.response.impacts import Impacts as Impacts
from femimpact.response.impacts import ImpactStatistics as ImpactStatistics
from femimpact.response.response import Response as Response

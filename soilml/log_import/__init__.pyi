"""Types of the public names, which `soilml.log_import` loads on first use."""

from soilml.log_import.guesses.map_guess import init_map as init_map
from soilml.log_import.mapping.log_map import LogMap as LogMap
from soilml.log_import.mapping.log_map import read_map as read_map
from soilml.log_import.result import ImportedLog as ImportedLog
from soilml.log_import.workflow import import_log as import_log

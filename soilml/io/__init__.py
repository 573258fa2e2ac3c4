"""Reading and writing of tables and settings files; independent of the physics.

Tables of measurements come from CSV or Parquet files, settings from TOML files. Every error names
file, row and column, or file and key. Output files are written atomically.
"""

from soilml.io.atomic_files import (
    atomic_output,
    atomic_outputs,
    check_outputs,
    create_folder,
    output_files,
    save_text,
)
from soilml.io.parquet import read_parquet
from soilml.io.read_table import read_table
from soilml.io.table import Table
from soilml.io.text_tables import csv_text, format_table
from soilml.io.toml_settings import Settings, read_settings

__all__ = [
    "Settings",
    "Table",
    "atomic_output",
    "atomic_outputs",
    "check_outputs",
    "create_folder",
    "csv_text",
    "format_table",
    "output_files",
    "read_parquet",
    "read_settings",
    "read_table",
    "save_text",
]

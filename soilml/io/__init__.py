"""Reading and writing of tables and settings files; independent of the physics.

Tables of measurements come from CSV or Parquet files, settings from TOML files. Every error names
file, row and column, or file and key. Output files are written atomically.
"""

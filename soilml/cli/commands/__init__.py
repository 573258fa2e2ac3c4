"""Sub-commands of `soilml`, one module each; `soilml.cli.main.COMMANDS` lists them."""

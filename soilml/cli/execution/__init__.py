"""What the sub-commands do, one module each; `soilml/cli/commands` declares their arguments."""

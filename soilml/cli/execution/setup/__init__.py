"""What the commands about the installation and the first files do."""

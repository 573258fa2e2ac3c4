"""Commands about the installation and the first files: one that declares its arguments each."""

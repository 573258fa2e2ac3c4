"""Effects whose cause sits in the test rig."""

"""Effects whose cause sits in the wheel or track."""

"""Effects whose cause sits in the soil."""

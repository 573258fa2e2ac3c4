"""Effects whose cause sits in a sensor."""

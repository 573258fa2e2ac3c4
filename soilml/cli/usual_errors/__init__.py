"""Second answers: with the errors that sensors and models usually have."""

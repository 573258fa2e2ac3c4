"""The metadata of a model file as the runtime's objects; whatever is malformed is refused."""

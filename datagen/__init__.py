"""The ground: recipes become synthetic measured data. Imports soilml; is imported by training."""

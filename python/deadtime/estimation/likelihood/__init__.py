"""Maximum likelihood under the noise of a flight: air, trim, coloured and white sensor noise."""

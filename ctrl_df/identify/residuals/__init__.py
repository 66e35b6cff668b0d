"""What a fitted model leaves unexplained: tests, regions, missing forces."""

"""Mechanics of the chuck: reaction forces, elastic ring, jaw contact, grip."""

"""The profile of the workpiece: described, distorted, compensated, measured. Numbers in, numbers out."""

"""The strategies, a descriptor each; `drivers.cutting.strategy` registers them."""

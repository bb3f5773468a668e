"""The tool axis: servo, response, friction, stiffness, and the speed that it can follow."""

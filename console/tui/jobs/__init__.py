"""What the page Jobs is made of besides its panels."""

"""What is known of every pixel in a direction, the material fitted to it, and how both are stored."""

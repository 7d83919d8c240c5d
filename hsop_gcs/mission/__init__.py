"""The mission: from the picture to plans, from approved plans to orders, and what became of them."""

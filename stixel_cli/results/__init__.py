"""Result folders: write, read and list them."""

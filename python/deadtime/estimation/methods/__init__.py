"""The methods of estimation, alike ones in one file, and what their results share."""

"""The methods of estimation, one file each, and what their results share."""

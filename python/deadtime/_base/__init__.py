"""What all packages use: errors, arguments, frozen results, processes, progress, drawing, pages."""

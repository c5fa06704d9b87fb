"""What every room uses: errors, arguments, frozen results, processes, progress, drawing, pages."""

"""What every room uses: errors, checked arguments, frozen results, processes, drawing, pages."""

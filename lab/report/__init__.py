"""Write the results of experiments as a page and as files of numbers, and print them in the terminal."""

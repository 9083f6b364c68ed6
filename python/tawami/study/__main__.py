"""One run of a study; started by `Study.run`, not by hand."""

from tawami.study.process import main

main()

"""From step to step: load ramps, settling, Newmark integration, transfers and energy."""

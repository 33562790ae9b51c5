"""What measures and judges: experiments, reports, profiles, the drop test."""

"""The operator's side: experiments, streamer, controller, runtime, analysis, report and the command line."""

"""CANopen node of a servo drive: CiA 301 (communication) and CiA 402 (drive profile).

Pure: frames and times in, frames and demands out. No input, no output, no clock, no threads.
Imports the standard library, numpy and planners; canopen only to parse the EDS file.
"""

"""Pictures as a camera's sensor reads them: `model` from light to numbers, `noise` its random draws, `dng` the raw file."""

"""A picture in a notebook with its exposure and its error at hand, without a kernel: all that this needs is in its HTML."""

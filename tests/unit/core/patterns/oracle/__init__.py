"""What MaterialX's primitive nodes compute, in double precision and by numpy: written from the specification's text and the
library's definitions, apart from the product's own compiler. Values are (N, width)."""

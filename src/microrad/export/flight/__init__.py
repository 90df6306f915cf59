"""Controllers as C99 in double or single precision or fixed point: code, bound of its error, cost, test bench."""

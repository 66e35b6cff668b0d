"""How a model predicts a record: segments begun anew, initial states, the simulator behind them."""

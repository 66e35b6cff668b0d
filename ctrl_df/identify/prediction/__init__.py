"""How a model predicts a record: segments restarted, initial states, the simulator behind them."""

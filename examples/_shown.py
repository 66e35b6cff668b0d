"""How the examples deal with their picture: shown with --show, saved with --out FILE, else closed."""

import argparse

import matplotlib.pyplot as plt


def finish(figure):
    parser = argparse.ArgumentParser()
    parser.add_argument("--show", action="store_true", help="open the picture")
    parser.add_argument("--out", metavar="FILE", help="save the picture")
    options = parser.parse_args()
    if options.out:
        figure.savefig(options.out, dpi=130)
    if options.show:
        plt.show()
    plt.close(figure)

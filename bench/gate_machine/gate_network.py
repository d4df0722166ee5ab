#!/usr/bin/env python3
"""The gate machine of config/gate_machine as a network of lumps: prints network.toml.

Conduction in a cast-iron frame (columns of 271 x 60 mm, 640 mm high, heated up to 320 mm through
the wall of a tank; a tie of 657 mm^2 274 mm above the ground, almost without contact to them), and
the effect of each lump's temperature on tool and work 519 mm above it: columns as cantilevers bent
by the first moment of their temperature over the width, the tie as a spring between them. The
temperature is thus not linear across the column, unlike in Ki (A - B) - Kc C. The publication
(Teratani et al. 1995) gives no dimensions; these reproduce its curves (docs/measurements.md).

    gate_network.py > config/gate_machine/network.toml
    gate_network.py --coefficients      Ki and Kc of the formulas
"""

import sys

LAYERS, HEIGHTS, TANK, TIE = 6, 8, 4, 10
WIDTH, DEPTH, HEIGHT, WORK, HEATED = 0.2715, 0.06, 0.64, 0.5187, 0.32
TIE_AT, TIE_LENGTH, TIE_AREA, TIE_DEPTH = 0.2737, 0.4, 656.6e-6, 0.012
MODULUS, EXPANSION, CONDUCTIVITY, CAPACITY = 125e9, 10.5e-6, 46.0, 7250 * 500.0
WALL, WALL_CAPACITY = 0.00441, 7850 * 480.0
# W/m^2 K: oil and wall, wall and column, wall and room, columns and room, columns and ground, tie
# and room, tie and air warmed by the tank, tie and columns
OIL, GASKET, WALL_ROOM, AIR, FOOT = 818.5, 35090.0, 51.17, 1.228, 70.35
TIE_AIR, TIE_OIL, TIE_JOINT = 0.843, 0.3294, 38.22

DX, DZ, DL = WIDTH / LAYERS, HEIGHT / HEIGHTS, TIE_LENGTH / TIE
INERTIA = DEPTH * WIDTH**3 / 12
UM = 1e6


def influence(at, force_at):
    """Deflection of a column at one height per force at another [m/N]."""
    low, high = min(at, force_at), max(at, force_at)
    return low * low * (3 * high - low) / (6 * MODULUS * INERTIA)


# Opening between tool and work per m of excess length of the tie.
PARTED = 2 * influence(WORK, TIE_AT) / (
    2 * influence(TIE_AT, TIE_AT) + TIE_LENGTH / (TIE_AREA * MODULUS))


def reach(height, low, high):
    """Displacement at a height of a column that is bent by 1/m from low to high."""
    high = min(high, height)
    return 0.0 if high <= low else height * (high - low) - (high**2 - low**2) / 2


def node(name, capacity, room, coolant=0.0, um_per_K=0.0):
    print(f'[[node]]\nname = "{name}"\ncapacity_J_per_K = {capacity:.5g}\nroom_W_per_K = {room:.5g}')
    if coolant:
        print(f"coolant_W_per_K = {coolant:.5g}")
    if um_per_K:
        print(f"displacement_um_per_K = {{ x_um = {um_per_K:.6g} }}")


def link(first, second, conductance):
    print(f'[[link]]\nbetween = ["{first}", "{second}"]\nconductance_W_per_K = {conductance:.5g}')


def warm_column():
    for z in range(HEIGHTS):
        bends = reach(WORK, z * DZ, (z + 1) * DZ) - PARTED * reach(TIE_AT, z * DZ, (z + 1) * DZ)
        for x in range(LAYERS):
            lever = WIDTH / 2 - (x + 0.5) * DX
            node(f"warm_{z + 1}_{x + 1}", CAPACITY * DX * DEPTH * DZ,
                 AIR * 2 * DX * DZ + (AIR * DEPTH * DZ if x == LAYERS - 1 else 0)
                 + (FOOT * DX * DEPTH if z == 0 else 0),
                 um_per_K=UM * EXPANSION * lever * DEPTH * DX / INERTIA * bends)


def others():
    for z in range(HEIGHTS):
        node(f"cold_{z + 1}", CAPACITY * WIDTH * DEPTH * DZ,
             AIR * 2 * (WIDTH + DEPTH) * DZ + (FOOT * WIDTH * DEPTH if z == 0 else 0))
    for z in range(TANK):
        node(f"tank_{z + 1}", WALL_CAPACITY * WALL * DEPTH * DZ, WALL_ROOM * DEPTH * DZ,
             coolant=OIL * DEPTH * DZ)
    around = 2 * (TIE_DEPTH + TIE_AREA / TIE_DEPTH)
    for i in range(TIE):
        node(f"tie_{i + 1}", CAPACITY * TIE_AREA * DL, TIE_AIR * around * DL,
             coolant=TIE_OIL * around * DL, um_per_K=-UM * EXPANSION * DL * PARTED)


def links():
    for z in range(HEIGHTS):
        for x in range(LAYERS):
            if x < LAYERS - 1:
                link(f"warm_{z + 1}_{x + 1}", f"warm_{z + 1}_{x + 2}",
                     CONDUCTIVITY * DEPTH * DZ / DX)
            if z < HEIGHTS - 1:
                link(f"warm_{z + 1}_{x + 1}", f"warm_{z + 2}_{x + 1}",
                     CONDUCTIVITY * DEPTH * DX / DZ)
        if z < HEIGHTS - 1:
            link(f"cold_{z + 1}", f"cold_{z + 2}", CONDUCTIVITY * WIDTH * DEPTH / DZ)
    for z in range(TANK):
        link(f"tank_{z + 1}", f"warm_{z + 1}_1",
             DEPTH * DZ / (1 / GASKET + DX / 2 / CONDUCTIVITY))
    for i in range(TIE - 1):
        link(f"tie_{i + 1}", f"tie_{i + 2}", CONDUCTIVITY * TIE_AREA / DL)
    at = int(TIE_AT / DZ) + 1
    end = TIE_AREA / (1 / TIE_JOINT + DL / 2 / CONDUCTIVITY)
    link(f"warm_{at}_{LAYERS}", "tie_1", end)
    link(f"tie_{TIE}", f"cold_{at}", end)


def main():
    if sys.argv[1:] == ["--coefficients"]:
        bent = TIE_AT**2 if TIE_AT <= HEATED else HEATED * (2 * TIE_AT - HEATED)
        free = HEATED * (2 * WORK - HEATED)
        print(f"Ki {UM * EXPANSION / (2 * WIDTH) * (free - PARTED * bent):.3f} um/K")
        print(f"Kc {UM * EXPANSION * TIE_LENGTH * PARTED:.3f} um/K")
        return
    print("# Made by: bench/gate_machine/gate_network.py, which says what it is.")
    warm_column()
    others()
    links()


if __name__ == "__main__":
    main()

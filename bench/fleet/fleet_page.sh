#!/bin/sh
# The page of 200 machines with a year of nights and ten days of minutes, from a real PostgreSQL: first
# paint with the whole table, its curves, and the store's time for each.
set -eu
exec /usr/bin/python3 "$(dirname "$0")/fleet_page.py"

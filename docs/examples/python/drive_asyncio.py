#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Drives a motor and shows what it does, with asyncio. Usage: drive_asyncio.py URL"""
import asyncio
import sys

from r4link import aio


async def main(url: str) -> None:
    async with aio.Board(url) as board:
        await board.wait_active()
        await board.arm()
        await board.osmc(1).set(0.1)
        count = 0
        async for state in board.states():
            count += 1
            if count % 10 == 0:
                direction = 'forward' if state.osmc1.direction else 'reverse'
                print(f'OSMC 1: {state.osmc1.pwm} {direction}, {state.ain24:.2f} V')
            if count == 30:
                break
        await board.osmc(1).set(0)


if __name__ == '__main__':
    asyncio.run(main(sys.argv[1]))

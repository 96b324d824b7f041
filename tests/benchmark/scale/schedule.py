#!/usr/bin/env python3
"""How long a site takes on a cluster, from the step times of rooms that were done (site.json of roomtex-site): the steps
of a room one after the other, rooms beside each other, each job on one slot, the longest waiting job first (docs/scale.md).

  tests/benchmark/scale/schedule.py site.json --slots 3                       # the same rooms
  tests/benchmark/scale/schedule.py site.json --rooms 1000 --slots 16 160     # these rooms again and again
"""

import argparse
import heapq
import json

STEPS = ["features", "matches", "mapper", "align", "texture", "pictures"]


def simulate(rooms, slots, overhead):
    """The time when the last step ends, and the time that slots worked; rooms: lists of seconds."""
    ready = [(0.0, number, 0) for number in range(len(rooms))]  # since when, room, step
    free = [0.0] * slots
    heapq.heapify(ready)
    end = worked = 0.0
    while ready:
        since, room, step = heapq.heappop(ready)
        start = max(since, heapq.heappop(free))
        done = start + rooms[room][step] + overhead
        heapq.heappush(free, done)
        worked += done - start
        end = max(end, done)
        if step + 1 < len(rooms[room]):
            heapq.heappush(ready, (done, room, step + 1))
    return end, worked


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("site", help="site.json")
    parser.add_argument("--rooms", type=int, default=0, help="0 = those of site.json")
    parser.add_argument("--slots", type=int, nargs="+", default=[1], help="jobs that run side by side")
    parser.add_argument("--overhead", type=float, default=0, help="seconds that a job takes beside its step")
    parser.add_argument("--cpu", type=int, default=0, help="CPU seconds in place of seconds, on so many cores a job")
    parser.add_argument("--factor", type=float, default=1, help="larger rooms: times so much")
    a = parser.parse_args()
    measured = []
    for room in json.load(open(a.site))["rooms"]:
        steps = [room["steps"][name] for name in STEPS if name in room["steps"]]
        times = [step["cpu_seconds"] / a.cpu if a.cpu else step["seconds"] for step in steps]
        if times:
            measured.append([a.factor * time for time in times])
    rooms = [measured[i % len(measured)] for i in range(a.rooms or len(measured))]
    longest = max(sum(room) + a.overhead * len(room) for room in rooms)
    print("| slots | hours | slots at work | longest room, hours |\n|---|---|---|---|")
    for slots in a.slots:
        end, worked = simulate(rooms, slots, a.overhead)
        print(f"| {slots} | {end / 3600:.3f} | {100 * worked / (slots * end):.0f} % | {longest / 3600:.3f} |")


if __name__ == "__main__":
    main()

/* Moves the end of a belt along a short path at constant steps, and prints where its middle goes and the force on its end. */
#include <stdio.h>
#include <stdlib.h>

#include "fishbone.h"

enum { STEPS = 20, MOST_NODES = 1000 };

/* Ends the program where a call has failed. */
static void check(FishboneStatus status) {
    if (status != FISHBONE_OK) {
        fprintf(stderr, "%s\n", fishbone_last_error());
        exit(EXIT_FAILURE);
    }
}

static const size_t end = 1; /* supports[1] of the scenario */

static FishboneTracker *tracker_of_end(const char *path) {
    FishboneScenario *scenario;
    FishboneEquilibrium *equilibrium;
    FishboneTracker *tracker;
    check(fishbone_scenario_load(path, &scenario));
    check(fishbone_solve(scenario, &equilibrium));
    check(fishbone_tracker_new(equilibrium, &end, 1, &tracker));
    fishbone_equilibrium_free(equilibrium);
    fishbone_scenario_free(scenario);
    return tracker;
}

int main(int argc, char **argv) {
    static double positions[3 * MOST_NODES];
    const FishboneLimits limits = {0.02, 0}; /* 20 ms, and as many iterations as fit */
    FishboneTracker *tracker = tracker_of_end(argc > 1 ? argv[1] : "scenarios/example1.toml");
    for (int step = 1; step <= STEPS; step++) {
        const FishboneGoal goal = {end, {0.0, 0.5 + 0.005 * step, 0.1}, {0.0, 0.0, 0.01 * step}};
        FishboneUpdate update;
        FishboneWrench reaction;
        size_t nodes;
        check(fishbone_tracker_update(tracker, &goal, 1, &limits, &update));
        if (update.status != FISHBONE_CONVERGED) {
            fprintf(stderr, "step %d: %s\n", step, fishbone_last_error());
            exit(EXIT_FAILURE);
        }
        check(fishbone_tracker_nodes(tracker, &nodes));
        check(fishbone_tracker_positions(tracker, positions, 3 * MOST_NODES));
        check(fishbone_tracker_reaction(tracker, end, &reaction));
        const double *x = &positions[3 * (nodes / 2)], *f = reaction.force;
        printf("%2d  middle %9.6f %9.6f %9.6f", step, x[0], x[1], x[2]);
        printf("  force %10.5f %10.5f %10.5f\n", f[0], f[1], f[2]);
    }
    fishbone_tracker_free(tracker);
    return EXIT_SUCCESS;
}

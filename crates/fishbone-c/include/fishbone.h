/*
 * fishbone: equilibrium shapes of thin belts, followed at the rate of a robot.
 *
 * Numbers are in the units of the scenario, vectors and frames in world axes. Supports are named by their places in the
 * scenario, from 0. A support's rotation is its rotation vector.
 *
 * Errors: a call that can fail returns a FishboneStatus, and fishbone_last_error() has one line for people. A call that has
 * failed has changed nothing and written nothing, unless its own description has an exception. No panic leaves a call.
 *
 * Handles: those that a call makes are freed by the function that ends with _free, once.
 *
 * Pointers: a null pointer is refused; any other leads to what its type says. A text ends with 0, a vector has three
 * numbers, and a buffer has room for as many numbers as its capacity is. More room than is needed is allowed: numbers are
 * written from the buffer's start, node after node.
 *
 * Threads: a handle belongs to one thread at a time, different handles to any threads at once. Pass a handle on to another
 * thread, or a copy of a tracker, as you would any other memory.
 *
 * This file is made of crates/fishbone-c/src by cbindgen, through a test of that crate.
 */

#ifndef FISHBONE_H
#define FISHBONE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/**
 * How a call ended.
 */
typedef enum FishboneStatus {
  /**
   * The call has done what it does.
   */
  FISHBONE_OK = 0,
  /**
   * An argument is a null pointer.
   */
  FISHBONE_NULL_POINTER,
  /**
   * A buffer has less room than is needed.
   */
  FISHBONE_SMALL_BUFFER,
  /**
   * A file cannot be read, or a text is not UTF-8.
   */
  FISHBONE_UNREADABLE,
  /**
   * A scenario, or a pose of its support, is refused.
   */
  FISHBONE_INVALID_SCENARIO,
  /**
   * The scenario has no such support, or its method finds no reactions.
   */
  FISHBONE_NO_REACTION,
  /**
   * The equilibrium cannot be followed while the support moves.
   */
  FISHBONE_NO_TRACKER,
  /**
   * Bytes are no state of a tracker, or one of another version of fishbone.
   */
  FISHBONE_INVALID_STATE,
  /**
   * A fault of fishbone itself. The handles of the call can be freed; what they hold is not defined.
   */
  FISHBONE_INTERNAL,
} FishboneStatus;

/**
 * How a solve or an update ended.
 */
typedef enum FishboneOutcome {
  /**
   * The belt is in equilibrium.
   */
  FISHBONE_CONVERGED = 0,
  /**
   * No shape of the belt can meet the supports.
   */
  FISHBONE_INFEASIBLE,
  /**
   * The search ended without an equilibrium.
   */
  FISHBONE_NOT_CONVERGED,
} FishboneOutcome;

/**
 * The outcome of a solve: a shape of the belt, with its energy and its reactions.
 */
typedef struct FishboneEquilibrium FishboneEquilibrium;

/**
 * A checked scenario: a belt, its supports, its loads.
 */
typedef struct FishboneScenario FishboneScenario;

/**
 * An equilibrium and the supports that move.
 */
typedef struct FishboneTracker FishboneTracker;

/**
 * A force and a moment on the belt about the point of its support, world axes. A component is NaN where the shape does not
 * determine it.
 */
typedef struct FishboneWrench {
  /**
   * Force.
   */
  double force[3];
  /**
   * Moment.
   */
  double moment[3];
} FishboneWrench;

/**
 * Where a support goes.
 */
typedef struct FishboneGoal {
  /**
   * The support, by its place in the scenario, from 0.
   */
  size_t support;
  /**
   * Position, world axes.
   */
  double position[3];
  /**
   * Rotation vector, world axes; that of a support that holds no frame is not read.
   */
  double rotation[3];
} FishboneGoal;

/**
 * What an update may take; 0 is no limit.
 */
typedef struct FishboneLimits {
  /**
   * Time, in seconds: the update ends after the iteration in which it has passed.
   */
  double max_time;
  /**
   * Iterations.
   */
  size_t max_iterations;
} FishboneLimits;

/**
 * The outcome of a motion of the supports.
 */
typedef struct FishboneUpdate {
  /**
   * Whether the belt is in equilibrium at its goals; unless converged, the tracker is at a fraction of the way.
   */
  enum FishboneOutcome status;
  /**
   * Share of the way to the goals that was reached.
   */
  double fraction;
  /**
   * Whether the belt has no slack, so that its shape does not determine all reactions: these are not a number.
   */
  bool taut;
  /**
   * Whether the equilibrium that was followed ceased to exist or to be stable on the way, or could not be followed, and
   * the belt has snapped to another one.
   */
  bool snapped;
  /**
   * Whether the belt could not be followed to the pose, so that its problem there was solved afresh.
   */
  bool solved_afresh;
  /**
   * Iterations.
   */
  size_t iterations;
  /**
   * Largest displacement of a node in the largest snap; 0 without a snap.
   */
  double jump;
  /**
   * Energy released in all snaps.
   */
  double released;
  /**
   * Total potential of the tracker's present shape.
   */
  double energy;
  /**
   * Largest violation of what supports and links prescribe, lengths in belt lengths and turns in rad.
   */
  double residual;
} FishboneUpdate;

#ifdef __cplusplus
extern "C" {
#endif // __cplusplus

/**
 * One line of UTF-8: why the last call of this thread failed, or why its solve or update did not converge; empty if
 * neither.
 *
 * The text is valid up to the next call of this thread. This function is no such call, nor are those that free a handle.
 */
const char *fishbone_last_error(void);

/**
 * Reads a scenario file. Its name is UTF-8 and ends with .toml or .json.
 */
enum FishboneStatus fishbone_scenario_load(const char *path, struct FishboneScenario **scenario);

/**
 * Reads a scenario of a text in TOML.
 */
enum FishboneStatus fishbone_scenario_from_toml(const char *toml,
                                                struct FishboneScenario **scenario);

/**
 * Reads a scenario of a text in JSON, of the same structure.
 */
enum FishboneStatus fishbone_scenario_from_json(const char *json,
                                                struct FishboneScenario **scenario);

/**
 * Frees a scenario; a null pointer is left alone.
 */
void fishbone_scenario_free(struct FishboneScenario *scenario);

/**
 * Solves a scenario. A search that finds no equilibrium is no failure of the call: fishbone_equilibrium_status has its
 * outcome.
 */
enum FishboneStatus fishbone_solve(const struct FishboneScenario *scenario,
                                   struct FishboneEquilibrium **equilibrium);

/**
 * How the solve ended.
 */
enum FishboneStatus fishbone_equilibrium_status(const struct FishboneEquilibrium *equilibrium,
                                                enum FishboneOutcome *status);

/**
 * Total potential, loads included.
 */
enum FishboneStatus fishbone_equilibrium_energy(const struct FishboneEquilibrium *equilibrium,
                                                double *energy);

/**
 * Number of nodes.
 */
enum FishboneStatus fishbone_equilibrium_nodes(const struct FishboneEquilibrium *equilibrium,
                                               size_t *nodes);

/**
 * Arc lengths of the nodes, from the start of the belt: a number each.
 */
enum FishboneStatus fishbone_equilibrium_arc_lengths(const struct FishboneEquilibrium *equilibrium,
                                                     double *buffer,
                                                     size_t capacity);

/**
 * Positions of the nodes, world axes: three numbers each.
 */
enum FishboneStatus fishbone_equilibrium_positions(const struct FishboneEquilibrium *equilibrium,
                                                   double *buffer,
                                                   size_t capacity);

/**
 * Frames of the nodes: nine numbers each, a row-major matrix whose columns are the normal, the tangent and the width
 * direction in world axes.
 */
enum FishboneStatus fishbone_equilibrium_frames(const struct FishboneEquilibrium *equilibrium,
                                                double *buffer,
                                                size_t capacity);

/**
 * Bend at the nodes, in rad per unit of length: a number each.
 */
enum FishboneStatus fishbone_equilibrium_bend(const struct FishboneEquilibrium *equilibrium,
                                              double *buffer,
                                              size_t capacity);

/**
 * The reaction of a support on the belt. The support is named by its place in the scenario, from 0.
 */
enum FishboneStatus fishbone_equilibrium_reaction(const struct FishboneEquilibrium *equilibrium,
                                                  size_t support,
                                                  struct FishboneWrench *reaction);

/**
 * Frees an equilibrium; a null pointer is left alone.
 */
void fishbone_equilibrium_free(struct FishboneEquilibrium *equilibrium);

/**
 * Makes a tracker of an equilibrium that has converged to a minimum. The supports that are to move are named by their places
 * in the scenario, from 0, and hold a position each.
 */
enum FishboneStatus fishbone_tracker_new(const struct FishboneEquilibrium *equilibrium,
                                         const size_t *supports,
                                         size_t count,
                                         struct FishboneTracker **tracker);

/**
 * Makes another tracker in the same state, which moves by itself.
 */
enum FishboneStatus fishbone_tracker_copy(const struct FishboneTracker *tracker,
                                          struct FishboneTracker **copy);

/**
 * Moves supports to their goals, all together, and the belt with them; those without a goal stay. The limits may be null.
 *
 * Goals that the belt does not reach are no failure of the call: the status of the update has the outcome, and the tracker
 * stays at the last equilibrium on the way. A pose that no scenario may hold, such as one that is not finite, is refused.
 *
 * From the second update on nothing is allocated where the equilibrium is followed on its mesh and its ribs keep to the
 * edges of the board that bound them. Beyond: the mesh changes, and with it the number of nodes, where the error of the shape asks for it,
 * unless solver.elements of the scenario fixes the mesh; that of a slender belt is graded anew at every update.
 */
enum FishboneStatus fishbone_tracker_update(struct FishboneTracker *tracker,
                                            const struct FishboneGoal *goals,
                                            size_t count,
                                            const struct FishboneLimits *limits,
                                            struct FishboneUpdate *update);

/**
 * Total potential of the present shape, loads included.
 */
enum FishboneStatus fishbone_tracker_energy(const struct FishboneTracker *tracker, double *energy);

/**
 * Number of nodes of the present shape.
 */
enum FishboneStatus fishbone_tracker_nodes(const struct FishboneTracker *tracker, size_t *nodes);

/**
 * Arc lengths of the nodes, as fishbone_equilibrium_arc_lengths. Allocates.
 */
enum FishboneStatus fishbone_tracker_arc_lengths(const struct FishboneTracker *tracker,
                                                 double *buffer,
                                                 size_t capacity);

/**
 * Positions of the nodes, as fishbone_equilibrium_positions. Allocates nothing.
 */
enum FishboneStatus fishbone_tracker_positions(const struct FishboneTracker *tracker,
                                               double *buffer,
                                               size_t capacity);

/**
 * Frames of the nodes, as fishbone_equilibrium_frames. Allocates nothing.
 */
enum FishboneStatus fishbone_tracker_frames(const struct FishboneTracker *tracker,
                                            double *buffer,
                                            size_t capacity);

/**
 * Bend at the nodes, as fishbone_equilibrium_bend. Allocates nothing.
 */
enum FishboneStatus fishbone_tracker_bend(const struct FishboneTracker *tracker,
                                          double *buffer,
                                          size_t capacity);

/**
 * The reaction of a support on the belt, as fishbone_equilibrium_reaction. Allocates.
 */
enum FishboneStatus fishbone_tracker_reaction(const struct FishboneTracker *tracker,
                                              size_t support,
                                              struct FishboneWrench *reaction);

/**
 * Saves the state of a tracker as bytes, for the same version of fishbone; a tracker of them updates as this one, to the
 * bit.
 *
 * The number of bytes is written to size, also where the buffer has less room: a buffer of capacity 0, which may be null,
 * asks for it.
 */
enum FishboneStatus fishbone_tracker_save(const struct FishboneTracker *tracker,
                                          uint8_t *buffer,
                                          size_t capacity,
                                          size_t *size);

/**
 * Makes a tracker in a state that was saved.
 */
enum FishboneStatus fishbone_tracker_restore(const uint8_t *state,
                                             size_t size,
                                             struct FishboneTracker **tracker);

/**
 * Frees a tracker; a null pointer is left alone.
 */
void fishbone_tracker_free(struct FishboneTracker *tracker);

#ifdef __cplusplus
}  // extern "C"
#endif  // __cplusplus

#endif  /* FISHBONE_H */

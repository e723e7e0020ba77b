/* hapticeval.h: what a shared library defines so that `hapticeval run -r lib:./libmine.so` can judge it. C99, C++.
 * SI units, float64, points of `dimension` numbers, arrays in C order. All calls come from one thread; each self is on
 * its own. A struct begins with its size in the caller's header: new fields come at its end, so read and write no more
 * than `size` bytes. Functions return 0 or as told; below 0 the renderer broke, with a number of your own. */
#ifndef HAPTICEVAL_H
#define HAPTICEVAL_H
#include <stdint.h>
#ifdef __cplusplus
extern "C" {
#endif
#define HR_ABI 1u
enum { HR_OK = 0, HR_FREE = 0, HR_CONTACT = 1, HR_REFUSES_MODEL = 1, HR_REFUSES_HIP = 2 };
/* Flags: what a scene asks for, and what a renderer can do. One with neither HR_PLANE nor HR_SPACE is given both. */
enum { HR_PLANE = 1, HR_SPACE = 2, HR_BILATERAL = 4, HR_VISCOSITY = 8, HR_SPRING = 16, HR_FORCE_ONLY = 32,
       HR_MEMORYLESS = 64, HR_SMOOTH_ONLY = 128, HR_MOVING = 256 };
/* HR_BILATERAL: the surface holds the tool from both sides. HR_SPRING: force = stiffness * (ihip - hip) + damping.
 * HR_FORCE_ONLY: ihip is always hip. HR_MEMORYLESS: ihip depends on hip alone. HR_SMOOTH_ONLY: not for corners. */

typedef struct {
  uint32_t size, dimension, flags;  /* 2: edges in the plane, 3: triangles in space */
  uint32_t n_vertices, n_cells;
  double stiffness, damping;        /* N/m, N s/m: the gains */
  double mass, restitution;         /* kg, 0 to 1: of the tool */
  double viscosity, sampling_time;  /* kg/s, of the surface, with HR_VISCOSITY; s */
  const double *vertices;           /* n_vertices * dimension, m; yours to read until hr_destroy */
  const uint32_t *cells;            /* n_cells * dimension: edges, inside left; triangles, anticlockwise from outside */
  double chord_error;               /* m: how far these lie off the smooth model at the most */
} hr_scene;

typedef struct {
  uint32_t size, flags;             /* all zero at first: leave what does not concern you */
  double max_error;                 /* m: the chord_error to ask for; 0: 1e-4 of the model's size, 1e-3 in space */
  double standoff, resolution;      /* m: how far your surface lies off the given one, and is blurred along it */
  double stiffness_least, stiffness_largest;  /* if it varies: its range, as shares of the scene's, with 1 in it */
  double force_resolution;          /* N: how coarse the force is, as a quantum or a dead band */
} hr_info;

uint32_t hr_abi(void);  /* return HR_ABI */
int32_t hr_info_get(const void *self, hr_info *info);  /* self NULL: flags and max_error; else standoff, resolution */
int32_t hr_create(const hr_scene *scene, void **self, char *why, uint32_t n);  /* if HR_REFUSES_MODEL, n bytes of why */
int32_t hr_reset(void *self, const double *hip, const double *tool);  /* a run begins; tool: a free start for it */
int32_t hr_step(void *self, const double *hip, const double *velocity, double dt, double *ihip, double *force);
  /* HR_FREE (ihip = hip, force = 0), HR_CONTACT, or HR_REFUSES_HIP outside your domain; always write ihip and force. The force acts on the hand */
void hr_destroy(void *self);
int32_t hr_place(void *self, const double *pose);  /* with HR_MOVING, before hr_reset and each hr_step: x of the mesh is at
  R x + t, where pose is R, row by row, then t (m); hip, velocity, tool, ihip and force are then in the world */
#ifdef __cplusplus
}
#endif
#endif

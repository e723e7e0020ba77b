/* A penalty renderer: the hand inside the model is pushed to the nearest point of its surface, without memory.
 * It goes through all edges or triangles in each tick. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "hapticeval.h"

typedef struct {
  int dimension;
  uint32_t n_vertices, n_cells;
  double stiffness, low[3], high[3];
  const double *vertices;
  const uint32_t *cells;
} penalty;

static double dot(const double *a, const double *b, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; i++) sum += a[i] * b[i];
  return sum;
}

static double square(const double *a, const double *b, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; i++) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return sum;
}

/* Write the nearest point of the segment a b to p. */
static void on_segment(const double *a, const double *b, const double *p, int n, double *foot) {
  double along = 0.0, length = square(a, b, n);
  for (int i = 0; i < n; i++) along += (p[i] - a[i]) * (b[i] - a[i]);
  along = fmin(fmax(along / length, 0.0), 1.0);
  for (int i = 0; i < n; i++) foot[i] = a[i] + along * (b[i] - a[i]);
}

/* Write the nearest point of the triangle a b c to p: its foot on the plane, or that on the nearest side. */
static void on_triangle(const double *a, const double *b, const double *c, const double *p, double *foot) {
  double u[3], v[3], w[3], side[3];
  for (int i = 0; i < 3; i++) u[i] = b[i] - a[i], v[i] = c[i] - a[i], w[i] = p[i] - a[i];
  double uu = dot(u, u, 3), uv = dot(u, v, 3), vv = dot(v, v, 3), wu = dot(w, u, 3), wv = dot(w, v, 3);
  double area = uu * vv - uv * uv, s = (vv * wu - uv * wv) / area, t = (uu * wv - uv * wu) / area;
  if (s >= 0.0 && t >= 0.0 && s + t <= 1.0) {
    for (int i = 0; i < 3; i++) foot[i] = a[i] + s * u[i] + t * v[i];
    return;
  }
  on_segment(a, b, p, 3, foot);
  on_segment(b, c, p, 3, side);
  if (square(side, p, 3) < square(foot, p, 3)) memcpy(foot, side, sizeof side);
  on_segment(c, a, p, 3, side);
  if (square(side, p, 3) < square(foot, p, 3)) memcpy(foot, side, sizeof side);
}

/* Return the angle under which an edge, or the solid angle under which a triangle, is seen from p. */
static double seen(const double *const *corner, const double *p, int n) {
  double d[3][3] = {{0}}, r[3];
  for (int k = 0; k < n; k++) {
    for (int i = 0; i < n; i++) d[k][i] = corner[k][i] - p[i];
    r[k] = sqrt(dot(d[k], d[k], n));
  }
  if (n == 2) return atan2(d[0][0] * d[1][1] - d[0][1] * d[1][0], dot(d[0], d[1], 2));
  double volume = d[0][0] * (d[1][1] * d[2][2] - d[1][2] * d[2][1]) + d[0][1] * (d[1][2] * d[2][0] - d[1][0] * d[2][2]) +
                  d[0][2] * (d[1][0] * d[2][1] - d[1][1] * d[2][0]);
  return 2.0 * atan2(volume, r[0] * r[1] * r[2] + r[0] * dot(d[1], d[2], 3) + r[1] * dot(d[2], d[0], 3) +
                                 r[2] * dot(d[0], d[1], 3)); /* van Oosterom and Strackee */
}

uint32_t hr_abi(void) { return HR_ABI; }

int32_t hr_info_get(const void *self, hr_info *info) {
  if (!self) info->flags = HR_PLANE | HR_SPACE | HR_SPRING;
  return HR_OK;
}

int32_t hr_create(const hr_scene *scene, void **self, char *why, uint32_t n) {
  penalty *made = calloc(1, sizeof *made);
  if (!made) return -1;
  if (scene->n_cells > 100000) {
    snprintf(why, n, "%s", "too many triangles to go through in a tick"); /* ends with a zero, whatever n is */
    free(made);
    return HR_REFUSES_MODEL;
  }
  made->dimension = (int)scene->dimension;
  made->n_vertices = scene->n_vertices, made->n_cells = scene->n_cells;
  made->stiffness = scene->stiffness;
  made->vertices = scene->vertices, made->cells = scene->cells;
  for (int i = 0; i < made->dimension; i++) {
    made->low[i] = made->high[i] = scene->vertices[i];
    for (uint32_t k = 0; k < scene->n_vertices; k++) {
      made->low[i] = fmin(made->low[i], scene->vertices[k * scene->dimension + i]);
      made->high[i] = fmax(made->high[i], scene->vertices[k * scene->dimension + i]);
    }
  }
  *self = made;
  return HR_OK;
}

int32_t hr_reset(void *self, const double *hip, const double *tool) {
  (void)self, (void)hip, (void)tool; /* nothing is remembered */
  return HR_OK;
}

int32_t hr_step(void *self, const double *hip, const double *velocity, double dt, double *ihip, double *force) {
  const penalty *r = self;
  int n = r->dimension, boxed = 1;
  (void)velocity, (void)dt;
  for (int i = 0; i < n; i++) {
    if (!isfinite(hip[i])) return HR_REFUSES_HIP;
    boxed = boxed && r->low[i] < hip[i] && hip[i] < r->high[i];
    ihip[i] = hip[i], force[i] = 0.0;
  }
  if (!boxed) return HR_FREE;
  double angle = 0.0, nearest = INFINITY, foot[3], best[3] = {0};
  for (uint32_t k = 0; k < r->n_cells; k++) {
    const double *corner[3] = {0};
    for (int i = 0; i < n; i++) corner[i] = r->vertices + (size_t)r->cells[k * (uint32_t)n + (uint32_t)i] * (size_t)n;
    angle += seen(corner, hip, n);
    if (n == 2) on_segment(corner[0], corner[1], hip, n, foot);
    else on_triangle(corner[0], corner[1], corner[2], hip, foot);
    double far = square(foot, hip, n);
    if (far < nearest) nearest = far, memcpy(best, foot, sizeof best);
  }
  if (angle < 3.0) return HR_FREE; /* it is 2 pi, or 4 pi, inside, and 0 outside */
  for (int i = 0; i < n; i++) ihip[i] = best[i], force[i] = r->stiffness * (ihip[i] - hip[i]);
  return HR_CONTACT;
}

void hr_destroy(void *self) { free(self); }

/* Forests with many trees, refined at points and balanced by p4est: what ci/history audits.
 *
 *   forest random FIRST COUNT DIR            for each seed: DIR/SEED (connectivity), DIR/SEED.points, and as `run`, DIR/SEED.before and .after
 *   forest run TYPE CONNECTIVITY POINTS BEFORE AFTER
 *
 * TYPE is the way of touching that is balanced: face, edge, corner, or `repaired`: corner, and what p4est_iterate shows is still
 * unbalanced is refined until nothing is. A line of POINTS is `tree x y z level`: octants that contain the point, in
 * 1024ths of the tree, are refined to the level. Prints one line per forest: its name, the number of trees, and what
 * p4est_is_balanced says over faces, edges and corners, before and after (on one rank).
 *
 * Compiled for quadtrees, and with -DOCTREES for octrees.
 */
#ifdef OCTREES
#include <p4est_to_p8est.h>
#include <p8est_bits.h>
#include <p8est_communication.h>
#include <p8est_extended.h>
#include <p8est_iterate.h>
#define Z(...) __VA_ARGS__
#define EDGE P8EST_CONNECT_EDGE
#else
#include <p4est_bits.h>
#include <p4est_communication.h>
#include <p4est_extended.h>
#include <p4est_iterate.h>
#define Z(...)
#define EDGE P4EST_CONNECT_FACE
#endif
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { DIM = P4EST_DIM, CORNERS = P4EST_CHILDREN, GRID = 1024, POINTS_MAX = 64 };

typedef struct {
    int count;
    struct { int tree, at[3], level; } of[POINTS_MAX];
} points_t;

static unsigned long long state;

static int below(int n)
{
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return (int) ((state >> 33) % (unsigned) n);
}

/* Cubes of a grid, some missing, each numbered as after a random rotation. A wrapped first axis may be twisted, as a Moebius strip. */
static p4est_connectivity_t *bricks(void)
{
    int n[3] = {1, 1, 1}, wrapped = below(3) == 0, twisted = wrapped && below(2), full = below(2), cells[64][3], trees = 0;
    for (int a = 0; a < DIM; ++a) n[a] = 1 + below(3);
    if (wrapped) n[0] = 3 + below(2);
    for (int i = 0; i < n[0] * n[1] * n[2]; ++i) {
        int cell[3] = {i % n[0], i / n[0] % n[1], i / n[0] / n[1]};
        if (full || below(3) > 0 || (i + 1 == n[0] * n[1] * n[2] && trees == 0)) memcpy(cells[trees++], cell, sizeof cell);
    }
    int vertices = (n[0] + 1) * (n[1] + 1) * (n[2] + 1);
    p4est_connectivity_t *c = p4est_connectivity_new(vertices, trees, Z(0, 0, ) 0, 0);
    for (int v = 0; v < vertices; ++v) {
        int at[3] = {v % (n[0] + 1), v / (n[0] + 1) % (n[1] + 1), v / (n[0] + 1) / (n[1] + 1)};
        for (int a = 0; a < 3; ++a) c->vertices[3 * v + a] = at[a];
    }
    for (int t = 0; t < trees; ++t) {
        int axes[3] = {0, 1, 2}, flip[3] = {below(2), below(2), DIM == 3 ? below(2) : 0}, odd = 0;
        for (int a = DIM - 1; a > 0; --a) {
            int b = below(a + 1), swap = axes[a];
            odd ^= a != b;
            axes[a] = axes[b];
            axes[b] = swap;
        }
        /* Trees are right-handed. */
        if (DIM == 3) flip[2] = (odd + flip[0] + flip[1]) % 2;
        for (int k = 0; k < CORNERS; ++k) {
            int v[3];
            for (int a = 0; a < 3; ++a) v[axes[a]] = cells[t][axes[a]] + (a < DIM ? (k >> a & 1) ^ flip[a] : 0);
            if (wrapped && v[0] == n[0]) {
                v[0] = 0;
                for (int a = 1; a < DIM; ++a) v[a] = twisted ? n[a] - v[a] : v[a];
            }
            c->tree_to_vertex[CORNERS * t + k] = v[0] + (n[0] + 1) * (v[1] + (n[1] + 1) * v[2]);
        }
        for (int f = 0; f < P4EST_FACES; ++f) {
            c->tree_to_tree[P4EST_FACES * t + f] = t;
            c->tree_to_face[P4EST_FACES * t + f] = (int8_t) f;
        }
    }
    p4est_connectivity_complete(c);
    return c;
}

/* Sets of tree corners, and of directed tree edges: each is represented by its least member. */
enum { TREES_MAX = 8, EDGES = 12, PLACES = TREES_MAX * 24 };

static int root(int *sets, int of)
{
    while (sets[of] != of) of = sets[of];
    return of;
}

static void unite(int *sets, int a, int b)
{
    a = root(sets, a);
    b = root(sets, b);
    sets[a > b ? a : b] = a < b ? a : b;
}

#ifdef OCTREES
/* The directed edge between two corners. */
static int edge_between(int from, int to)
{
    int edge = 0;
    while ((p8est_edge_corners[edge][0] != from || p8est_edge_corners[edge][1] != to) &&
           (p8est_edge_corners[edge][0] != to || p8est_edge_corners[edge][1] != from))
        ++edge;
    return edge + (from > to ? EDGES : 0);
}
#endif

/* The sets of more than one place as lists. Of directed edges, every other set is the same in the other direction. */
static int listed(int *sets, int places, int each, p4est_topidx_t *of_tree, p4est_topidx_t *offsets, p4est_topidx_t *trees, int8_t *codes)
{
    int lists = 0, members = 0, own = each == 2 * EDGES ? EDGES : each;
    for (int i = 0; i < places / each * own; ++i) of_tree[i] = -1;
    for (int i = 0; i < places; ++i) {
        int count = 0;
        for (int j = 0; j < places; ++j) count += root(sets, j) == i;
        if (count < 2 || of_tree[i / each * own + i % each % own] >= 0) continue;
        for (int j = 0; j < places; ++j)
            if (root(sets, j) == i) {
                trees[members] = j / each;
                codes[members++] = (int8_t) (j % each);
                of_tree[j / each * own + j % each % own] = lists;
            }
        offsets[++lists] = members;
    }
    return lists;
}

/* Cubes whose faces are glued at random, also with those of the same cube; NULL if an edge meets itself in the opposite direction.
 * p8est_connectivity_join_faces of 2.2 would list edges that do not meet. */
static p4est_connectivity_t *glued(void)
{
    int trees = 1 + below(4), count = 1 + below(2 * trees), corners[PLACES], edges[PLACES];
    p4est_topidx_t to_tree[TREES_MAX * P4EST_FACES];
    int8_t to_face[TREES_MAX * P4EST_FACES];
    for (int i = 0; i < PLACES; ++i) corners[i] = edges[i] = i;
    for (int i = 0; i < P4EST_FACES * trees; ++i) {
        to_tree[i] = i / P4EST_FACES;
        to_face[i] = (int8_t) (i % P4EST_FACES);
    }
    while (count-- > 0) {
        int own[2] = {below(P4EST_FACES * trees), below(P4EST_FACES * trees)}, orientation = below(P4EST_HALF);
        int are_free = own[0] != own[1], face[2] = {own[0] % P4EST_FACES, own[1] % P4EST_FACES};
        for (int i = 0; i < 2; ++i) are_free &= to_tree[own[i]] == own[i] / P4EST_FACES && to_face[own[i]] == own[i] % P4EST_FACES;
        for (int i = 0; i < 2 && are_free; ++i) {
            to_tree[own[i]] = own[1 - i] / P4EST_FACES;
            to_face[own[i]] = (int8_t) (face[1 - i] + P4EST_FACES * orientation);
        }
        int from[P4EST_HALF], to[P4EST_HALF];
        for (int k = 0; k < P4EST_HALF; ++k) {
            from[k] = p4est_face_corners[face[0]][k];
            to[k] = p4est_face_corners[face[1]][p4est_connectivity_face_neighbor_face_corner(k, face[0], face[1], orientation)];
            if (are_free) unite(corners, own[0] / P4EST_FACES * CORNERS + from[k], own[1] / P4EST_FACES * CORNERS + to[k]);
        }
#ifdef OCTREES
        for (int k = 0; k < 4 && are_free; ++k)
            for (int l = 0; l < 4; ++l)
                if ((k ^ l) == 1 || (k ^ l) == 2)
                    unite(edges, own[0] / 6 * 24 + edge_between(from[k], from[l]), own[1] / 6 * 24 + edge_between(to[k], to[l]));
#endif
    }
    for (int i = 0; i < 24 * trees; ++i)
        if (root(edges, i) == root(edges, i / 24 * 24 + (i + EDGES) % 24)) return NULL;
    p4est_topidx_t of_edge[PLACES], edge_ends[PLACES] = {0}, edge_trees[PLACES], of_corner[PLACES], ends[PLACES] = {0}, of_trees[PLACES];
    int8_t codes[PLACES], edge_codes[PLACES];
    int lists = listed(corners, CORNERS * trees, CORNERS, of_corner, ends, of_trees, codes), edge_lists = 0;
    Z(edge_lists = listed(edges, 24 * trees, 24, of_edge, edge_ends, edge_trees, edge_codes);)
    (void) of_edge, (void) edge_ends, (void) edge_trees, (void) edge_codes, (void) edge_lists;
    return p4est_connectivity_new_copy(0, trees, Z(edge_lists, ) lists, NULL, NULL, to_tree, to_face,
                                       Z(of_edge, edge_ends, edge_trees, edge_codes, ) of_corner, ends, of_trees, codes);
}

static p4est_connectivity_t *named(void)
{
#ifdef OCTREES
    const char *names[] = {"unit", "periodic", "rotwrap", "twocubes", "twowrap", "rotcubes", "shell", "sphere"};
#else
    const char *names[] = {"unit", "periodic", "rotwrap", "corner", "moebius", "star", "cubed", "disk", "pillow", "icosahedron"};
#endif
    p4est_connectivity_t *c = p4est_connectivity_new_byname(names[below((int) (sizeof names / sizeof *names))]);
    if (c == NULL) c = p4est_connectivity_new_byname("unit");
    return c;
}

static p4est_connectivity_t *random_connectivity(points_t *points)
{
    int kind = below(4);
    p4est_connectivity_t *c = kind < 2 ? bricks() : kind == 2 ? glued() : named();
    if (c == NULL) c = bricks();
    points->count = 1 + below(4);
    for (int i = 0; i < points->count; ++i) {
        points->of[i].tree = below(c->num_trees);
        points->of[i].level = 2 + below(4);
        for (int a = 0; a < 3; ++a) points->of[i].at[a] = a == DIM ? 0 : below(3) == 0 ? below(GRID) : below(2) * (GRID - 1);
    }
    return c;
}

static int contains_point(p4est_t *forest, p4est_topidx_t tree, p4est_quadrant_t *q)
{
    points_t *points = forest->user_pointer;
    p4est_qcoord_t unit = P4EST_ROOT_LEN / GRID, size = P4EST_QUADRANT_LEN(q->level), corner[3] = {q->x, q->y, Z(q->z)};
    for (int i = 0; i < points->count; ++i) {
        int contains = points->of[i].tree == tree && q->level < points->of[i].level;
        for (int a = 0; a < DIM; ++a)
            contains = contains && corner[a] <= points->of[i].at[a] * unit && points->of[i].at[a] * unit < corner[a] + size;
        if (contains) return 1;
    }
    return 0;
}

/* Marks the coarse sides of an edge or corner that levels differ at by more than one. */
static void mark(sc_array_t *sides, p4est_quadrant_t *(*of)(sc_array_t *, size_t, int), int each)
{
    int finest = 0;
    for (size_t i = 0; i < sides->elem_count; ++i)
        for (int j = 0; j < each; ++j) {
            p4est_quadrant_t *q = of(sides, i, j);
            if (q != NULL && q->level > finest) finest = q->level;
        }
    for (size_t i = 0; i < sides->elem_count; ++i)
        for (int j = 0; j < each; ++j) {
            p4est_quadrant_t *q = of(sides, i, j);
            if (q != NULL && q->level + 1 < finest) *(int *) q->p.user_data = 1;
        }
}

static p4est_quadrant_t *at_corner(sc_array_t *sides, size_t i, int j)
{
    (void) j;
    return ((p4est_iter_corner_side_t *) sc_array_index(sides, i))->quad;
}

static void corner(p4est_iter_corner_info_t *info, void *data)
{
    (void) data;
    mark(&info->sides, at_corner, 1);
}

#ifdef OCTREES
static p4est_quadrant_t *at_edge(sc_array_t *sides, size_t i, int j)
{
    p8est_iter_edge_side_t *side = sc_array_index(sides, i);
    if (side->is_hanging) return side->is.hanging.quad[j];
    return j == 0 ? side->is.full.quad : NULL;
}

static void edge(p8est_iter_edge_info_t *info, void *data)
{
    (void) data;
    mark(&info->sides, at_edge, 2);
}
#endif

static void unmark(p4est_t *forest, p4est_topidx_t tree, p4est_quadrant_t *q)
{
    (void) forest, (void) tree;
    *(int *) q->p.user_data = 0;
}

static int is_marked(p4est_t *forest, p4est_topidx_t tree, p4est_quadrant_t *q)
{
    (void) forest, (void) tree;
    return *(int *) q->p.user_data;
}

static void verdicts(p4est_t *forest)
{
    /* p4est_is_balanced may wait for ever on several ranks: harness/doc/history.md. */
    if (forest->mpisize > 1) return;
    int faces = p4est_is_balanced(forest, P4EST_CONNECT_FACE), edges = p4est_is_balanced(forest, EDGE);
    int corners = p4est_is_balanced(forest, P4EST_CONNECT_FULL);
    printf(" %d %d %d", faces, edges, corners);
}

static void run(const char *name, const char *type, p4est_connectivity_t *c, points_t *points, const char *before, const char *after)
{
    p4est_t *forest = p4est_new_ext(sc_MPI_COMM_WORLD, c, 0, 0, 1, sizeof(int), unmark, points);
    p4est_refine(forest, 1, contains_point, unmark);
    p4est_partition(forest, 0, NULL);
    if (forest->mpirank == 0) printf("%s %d", name, (int) c->num_trees);
    verdicts(forest);
    p4est_save(before, forest, 0);
    p4est_connect_type_t how = strcmp(type, "face") == 0 ? P4EST_CONNECT_FACE : strcmp(type, "edge") == 0 ? EDGE : P4EST_CONNECT_FULL;
    p4est_balance(forest, how, unmark);
    for (p4est_gloidx_t last = 0; strcmp(type, "repaired") == 0 && last != forest->global_num_quadrants;) {
        last = forest->global_num_quadrants;
        p4est_iterate(forest, NULL, NULL, NULL, NULL, Z(edge, ) corner);
        p4est_refine(forest, 0, is_marked, unmark);
        p4est_balance(forest, how, unmark);
    }
    verdicts(forest);
    p4est_save(after, forest, 0);
    if (forest->mpirank == 0) puts("");
    fflush(stdout);
    p4est_destroy(forest);
    p4est_connectivity_destroy(c);
}

static void random_forests(int first, int count, const char *place)
{
    for (int seed = first; seed < first + count; ++seed) {
        char name[4][4096];
        const char *endings[] = {"", ".points", ".before", ".after"};
        for (int i = 0; i < 4; ++i) snprintf(name[i], sizeof name[i], "%s/%d%s", place, seed, endings[i]);
        points_t points;
        state = (unsigned long long) seed * 7919 + DIM;
        for (int i = 0; i < 8; ++i) below(2);
        p4est_connectivity_t *c = random_connectivity(&points);
        p4est_connectivity_save(name[0], c);
        FILE *out = fopen(name[1], "w");
        for (int i = 0; out != NULL && i < points.count; ++i)
            fprintf(out, "%d %d %d %d %d\n", points.of[i].tree, points.of[i].at[0], points.of[i].at[1], points.of[i].at[2], points.of[i].level);
        if (out != NULL) fclose(out);
        run(strrchr(name[0], '/') + 1, "corner", c, &points, name[2], name[3]);
    }
}

int main(int argc, char **argv)
{
    sc_MPI_Init(&argc, &argv);
    sc_init(sc_MPI_COMM_WORLD, 0, 0, NULL, SC_LP_ERROR);
    p4est_init(NULL, SC_LP_ERROR);
    if (argc == 5 && strcmp(argv[1], "random") == 0) {
        random_forests(atoi(argv[2]), atoi(argv[3]), argv[4]);
    } else if (argc == 7 && strcmp(argv[1], "run") == 0) {
        points_t points = {0};
        p4est_connectivity_t *c = p4est_connectivity_load(argv[3], NULL);
        FILE *in = fopen(argv[4], "r");
        SC_CHECK_ABORT(c != NULL && in != NULL, "a file cannot be read");
        while (points.count < POINTS_MAX && fscanf(in, "%d %d %d %d %d", &points.of[points.count].tree, points.of[points.count].at,
                                                   points.of[points.count].at + 1, points.of[points.count].at + 2,
                                                   &points.of[points.count].level) == 5)
            ++points.count;
        fclose(in);
        run(argv[3], argv[2], c, &points, argv[5], argv[6]);
    } else {
        fprintf(stderr, "usage: forest random FIRST COUNT DIR | forest run TYPE CONNECTIVITY POINTS BEFORE AFTER\n");
        return 2;
    }
    sc_finalize();
    sc_MPI_Finalize();
    return 0;
}

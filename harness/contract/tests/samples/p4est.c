/* Writes a forest with p8est_save, and its cells as x,y,z,edge on standard output.
 *
 *   mpicc -o p4est p4est.c -lp4est -lsc && ./p4est FILE [TREES [DATA_BYTES]]
 */
#include <p8est_bits.h>
#include <p8est_extended.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int refine(p8est_t *forest, p4est_topidx_t tree, p8est_quadrant_t *q)
{
    (void) forest;
    return tree == 0 && q->level < 4 && q->x == 0 && q->y + q->z == q->y;
}

static void zero(p8est_t *forest, p4est_topidx_t tree, p8est_quadrant_t *q)
{
    (void) tree;
    memset(q->p.user_data, 0, forest->data_size);
}

int main(int argc, char **argv)
{
    int trees = argc > 2 ? atoi(argv[2]) : 1, data = argc > 3 ? atoi(argv[3]) : 0;
    sc_MPI_Init(&argc, &argv);
    sc_init(sc_MPI_COMM_WORLD, 1, 1, NULL, SC_LP_ERROR);
    p4est_init(NULL, SC_LP_ERROR);
    p8est_connectivity_t *connectivity = trees == 1 ? p8est_connectivity_new_unitcube()
                                                    : p8est_connectivity_new_brick(trees, 1, 1, 0, 0, 0);
    p8est_t *forest =
        p8est_new_ext(sc_MPI_COMM_WORLD, connectivity, 0, 0, 1, (size_t) data, data > 0 ? zero : NULL, NULL);
    p8est_refine(forest, 1, refine, data > 0 ? zero : NULL);
    p8est_balance(forest, P8EST_CONNECT_FULL, data > 0 ? zero : NULL);
    p8est_save(argv[1], forest, data > 0);
    puts("x,y,z,edge");
    for (p4est_topidx_t t = 0; t < connectivity->num_trees; ++t) {
        sc_array_t *quadrants = &p8est_tree_array_index(forest->trees, t)->quadrants;
        for (size_t i = 0; i < quadrants->elem_count; ++i) {
            p8est_quadrant_t *q = p8est_quadrant_array_index(quadrants, i);
            double at[3];
            p8est_qcoord_to_vertex(connectivity, t, q->x, q->y, q->z, at);
            printf("%.17g,%.17g,%.17g,%.17g\n", at[0], at[1], at[2],
                   (double) P8EST_QUADRANT_LEN(q->level) / P8EST_ROOT_LEN);
        }
    }
    p8est_destroy(forest);
    p8est_connectivity_destroy(connectivity);
    sc_finalize();
    sc_MPI_Finalize();
    return 0;
}

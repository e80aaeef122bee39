(** What an accepted mesh is. Whoever believes this file, and the few lines that README.md lists as trusted, need not believe any
    other. Numbers in brackets are sections of reference/DEFINITION.md. *)
From Coq Require Import ZArith List Relations.
Import ListNotations.
Open Scope Z_scope.

(** * Leaves and files *)
(** Lengths and coordinates are in cells of level 19, of which the root has 2^19 along an edge [1, 2]. *)
Definition cells (level : Z) : Z := 2 ^ (19 - level).
Inductive side := Outside | Inside | Crossing.
Record leaf := Leaf { cx : Z; cy : Z; cz : Z; level : Z; side_of : side }.
Definition edge (a : leaf) : Z := cells (level a).
(** A file of leaves [8, 11]: word i is [key i * 2^7 + code i], with [code i = level * 2^2 + side]. *)
Record part := Part { count : Z; key : Z -> Z; code : Z -> Z }.
(** Every third bit of the key, from bit [axis] on. *)
Fixpoint coordinate (bits : nat) (axis key : Z) : Z :=
  match bits with O => 0 | S b => (key / 2 ^ axis) mod 2 + 2 * coordinate b axis (key / 8) end.
Definition side_of_code (c : Z) : side := if c mod 4 =? 0 then Outside else if c mod 4 =? 1 then Inside else Crossing.
Definition leaf_at (p : part) (i : Z) : leaf :=
  Leaf (coordinate 19 0 (key p i)) (coordinate 19 1 (key p i)) (coordinate 19 2 (key p i)) (code p i / 4) (side_of_code (code p i)).
Definition leaves_of (p : part) : list leaf := map (leaf_at p) (map Z.of_nat (seq 0 (Z.to_nat (count p)))).
Definition leaves (parts : list part) : list leaf := flat_map leaves_of parts.
(** Words of a file are those of octants, and ascend. *)
Definition words (p : part) : Prop :=
  (forall i, 0 <= i < count p -> 0 <= key p i < 2 ^ 57 /\ 0 <= code p i / 4 <= 19 /\ code p i mod 4 <= 2) /\
  (forall i j, 0 <= i < j -> j < count p -> key p i < key p j).
(** The numbers of a manifest [11]. *)
Record manifest := Manifest { total : Z; by_level : list Z; by_side : list Z; by_part : list Z }.
Definition number (f : leaf -> bool) (s : list leaf) : Z := Z.of_nat (length (filter f s)).
Definition is_side (s t : side) : bool :=
  match s, t with Outside, Outside | Inside, Inside | Crossing, Crossing => true | _, _ => false end.
Definition counted (f : manifest) (parts : list part) : Prop :=
  by_part f = map count parts /\ total f = Z.of_nat (length (leaves parts)) /\
  by_level f = map (fun l => number (fun a => level a =? l) (leaves parts)) (map Z.of_nat (seq 0 20)) /\
  by_side f = map (fun s => number (fun a => is_side s (side_of a)) (leaves parts)) [Outside; Inside; Crossing].

(** * Geometry *)
(** The unit cell with minimum corner (u, v, w) lies in a leaf, in the root. *)
Definition holds (a : leaf) (u v w : Z) : Prop :=
  cx a <= u < cx a + edge a /\ cy a <= v < cy a + edge a /\ cz a <= w < cz a + edge a.
Definition in_root (u v w : Z) : Prop := 0 <= u < cells 0 /\ 0 <= v < cells 0 /\ 0 <= w < cells 0.
Definition octant (a : leaf) : Prop := 0 <= level a <= 19 /\ (edge a | cx a) /\ (edge a | cy a) /\ (edge a | cz a) /\
  forall u v w, holds a u v w -> in_root u v w.
Definition disjoint (a b : leaf) : Prop := forall u v w, holds a u v w -> holds b u v w -> False.
Definition within (a b : leaf) : Prop := forall u v w, holds a u v w -> holds b u v w.
(** Chebyshev distance of two closed cubes. *)
Definition gap (p e q f : Z) : Z := Z.max 0 (Z.max (q - (p + e)) (p - (q + f))).
Definition distance (a b : leaf) : Z :=
  Z.max (gap (cx a) (edge a) (cx b) (edge b)) (Z.max (gap (cy a) (edge a) (cy b) (edge b)) (gap (cz a) (edge a) (cz b) (edge b))).
Definition touch (a b : leaf) : Prop := distance a b = 0.
(** Disjoint leaves share part of a face if unit cells of theirs are neighbours. *)
Definition share_face (a b : leaf) : Prop := exists u v w u' v' w',
  holds a u v w /\ holds b u' v' w' /\ Z.abs (u - u') + Z.abs (v - v') + Z.abs (w - w') = 1.
Definition at_boundary (a : leaf) : Prop := cx a = 0 \/ cy a = 0 \/ cz a = 0 \/
  cx a + edge a = cells 0 \/ cy a + edge a = cells 0 \/ cz a + edge a = cells 0.

(** * Inputs [1]: D is the level of the surface, n the cells of a layer, a seed three lattice coordinates (256 along a unit cell) *)
Inductive choice := Keep_outside | Keep_inside | Keep_all.
Record inputs := Inputs
  { surface : Z; layer_cells : Z; keep : choice; keep_crossing : bool; seeds : list (Z * Z * Z); delete_enclosed : bool }.

Section Promises.
Variable c : inputs.
Variables base mesh dropped : list leaf.  (** T0, the final mesh, and the crossing leaves that were deleted after gradation *)
Let graded := mesh ++ dropped.
(** Disjoint octants, and those that fill the root. *)
Definition linear (s : list leaf) : Prop := (forall a, In a s -> octant a) /\ ForallOrdPairs disjoint s.
Definition tiles (s : list leaf) : Prop := linear s /\ forall u v w, in_root u v w -> exists a, In a s /\ holds a u v w.
(** [3, 4]: crossing leaves are fine, components have one side, and seeds determine it. *)
Definition fine : Prop := forall a, In a base -> side_of a = Crossing -> surface c <= level a.
Definition adjacent (a b : leaf) : Prop := In a base /\ In b base /\ side_of a <> Crossing /\ side_of b <> Crossing /\ share_face a b.
Definition connected : leaf -> leaf -> Prop := clos_refl_trans leaf adjacent.
Definition one_side : Prop := forall a b, connected a b -> side_of a = side_of b.
Definition seed_in (a : leaf) : Prop := exists p q r, In (p, q, r) (seeds c) /\ holds a (p / 256) (q / 256) (r / 256).
Definition flow : side := match keep c with Keep_inside => Inside | _ => Outside end.
Definition seeded : Prop := seeds c <> [] ->
  (forall p q r, In (p, q, r) (seeds c) -> in_root (p / 256) (q / 256) (r / 256)) /\
  (forall a, In a base -> seed_in a -> side_of a <> Crossing) /\
  forall a, In a base -> side_of a <> Crossing -> (side_of a = flow <-> exists b, In b base /\ seed_in b /\ connected a b).
(** [5] *)
Definition enclosed (a : leaf) : Prop := keep c = Keep_outside /\ seeds c = [] /\ delete_enclosed c = true /\ side_of a = Outside /\
  (exists b, In b base /\ side_of b = Outside /\ at_boundary b) /\ ~ exists b, In b base /\ at_boundary b /\ connected a b.
Definition deleted (a : leaf) : Prop :=
  keep c = Keep_outside /\ side_of a = Inside \/ keep c = Keep_inside /\ side_of a = Outside \/ enclosed a.
(** [6, 7]: kept and deleted leaves tile the root, and kept ones inherit their side. *)
Definition without_crossing : Prop := if keep_crossing c then dropped = [] else
  (forall a, In a mesh -> side_of a <> Crossing) /\ forall a, In a dropped -> side_of a = Crossing.
Definition complete : Prop := forall u v w, in_root u v w ->
  (exists a, In a graded /\ holds a u v w) \/ exists a, In a base /\ deleted a /\ holds a u v w.
Definition inherits : Prop := forall a, In a graded -> exists b, In b base /\ within a b /\ side_of a = side_of b /\ ~ deleted b.
(** [6]: an octant in a kept leaf of T0 is split if and only if it has a cause. Causes that precede the layer of its children's level are T0
    itself; balance, with finer leaves in o or beside it; and the extra layer, which makes up for deleted crossing leaves if n < 3. *)
Definition inside (a o : leaf) : Prop := within a o /\ level o < level a.
Definition split (o : leaf) : Prop := exists a, In a graded /\ inside a o.
Definition split_early (o : leaf) : Prop := (exists b, In b base /\ inside b o) \/
  (exists a, In a graded /\ level a >= level o + 2 /\ touch a o) \/
  keep_crossing c = false /\ layer_cells c < 3 /\ level o < surface c /\ exists b, In b base /\ side_of b = Crossing /\ touch b o.
(** The other cause is the layer around a source: a leaf that exists before the layer of its level, because its parent is split early. *)
Definition source (p : leaf) : Prop := In p graded /\ exists q, octant q /\ level q = level p - 1 /\ within p q /\ split_early q.
Definition in_layer (o : leaf) : Prop := exists p,
  source p /\ level p = level o + 1 /\ distance p o < (layer_cells c - 1) * cells (level p).
Definition least : Prop := forall o b, octant o -> In b base -> ~ deleted b -> within o b -> (split o <-> split_early o \/ in_layer o).
(** [7]. [balanced] and [near_surface] are not promised below, because they follow from what is: see Unique.v. *)
Definition layers : Prop := forall l a b, In a graded -> In b graded -> l < surface c \/ keep c = Keep_all ->
  level a >= l + 1 -> level b <= l - 1 -> distance a b >= layer_cells c * cells l.
Definition balanced : Prop := forall a b, In a graded -> In b graded -> touch a b -> Z.abs (level a - level b) <= 1.
Definition near_surface : Prop := forall a b, In a graded -> In b graded -> side_of b = Crossing -> level a < surface c ->
  (level b = surface c -> distance a b >= (layer_cells c - 1) * cells (surface c)) /\ (keep_crossing c = false -> ~ touch a b).
End Promises.

Definition promised (c : inputs) (base mesh dropped : list part) (of_base of_mesh : manifest) : Prop :=
  Forall words (base ++ mesh ++ dropped) /\ counted of_base base /\ counted of_mesh mesh /\
  let t := leaves base in let m := leaves mesh in let d := leaves dropped in
  tiles t /\ fine c t /\ one_side t /\ seeded c t /\
  linear (m ++ d) /\ without_crossing c m d /\ complete c t m d /\ inherits c t m d /\ least c t m d /\ layers c m d.

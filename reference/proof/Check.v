(** The program: what it accepts. *)
From Coq Require Import ZArith List Bool.
Import ListNotations.
From Proof Require Import Statement Checker Causes.
Open Scope Z_scope.

Section Check.
Variable c : inputs.

Definition kind_of_flow : kind := match keep c with Keep_inside => Inner | _ => Outer end.
Definition has_seeds : bool := match seeds c with [] => false | _ => true end.
Definition may_enclose : bool := match keep c with Keep_outside => negb has_seeds && delete_enclosed c | _ => false end.

Definition mark_seeds (t : tree) : tree :=
  fold_left (fun t '(p, q, r) => mark kind_of_flow 19 (Z.shiftr p 8) (Z.shiftr q 8) (Z.shiftr r 8) 0 0 0 524288 t) (seeds c) t.
Definition in_edge (p : Z) : bool := (0 <=? Z.shiftr p 8) && (Z.shiftr p 8 <? 524288).
Definition seeds_reached (t : tree) : bool :=
  forallb (fun '(p, q, r) => in_edge p && in_edge q && in_edge r &&
                             same Reached (spot 19 (Z.shiftr p 8) (Z.shiftr q 8) (Z.shiftr r 8) 0 0 0 524288 t)) (seeds c).

(** T0 in which the leaves that seeds reach, or the far field, are [Reached]. *)
Definition flooded (t : tree) : tree :=
  if has_seeds then rounds kind_of_flow (Cube Cross) 100 (mark_seeds t) (-1)
  else if may_enclose then rounds Outer (Cube Reached) 100 t (-1)
  else t.

(** T0 before the flood: full, and fine at crossing leaves. *)
Definition check_full (t : tree) : bool :=
  every (fun k => negb (same Empty k) && negb (same Reached k)) t && fine_tree (Z.shiftr 524288 (surface c)) t 524288.

(** T0 after the flood: components are of one kind, and none is left that should have been reached. *)
Definition check_base (t : tree) : bool :=
  faces kind_of_flow 20 t && (if has_seeds then seeds_reached t && every (fun k => negb (same kind_of_flow k)) t else true) &&
  (if may_enclose then rim Outer t else true).

(** What gradation leaves of a leaf of T0; [far] is whether there is a far field. *)
Definition fate (far : bool) (k : kind) : kind :=
  match k with
  | Empty => Empty
  | Cross => Cross
  | Reached => kind_of_flow
  | Outer => match keep c with Keep_outside => if may_enclose && far then Empty else Outer | Keep_inside => Empty | Keep_all => Outer end
  | Inner => match keep c with Keep_outside => Empty | _ => Inner end
  end.

Definition below : Z := match keep c with Keep_all => 20 | _ => surface c end.
Definition extra : bool := negb (keep_crossing c) && (layer_cells c <? 3).
(** Functions of their own, so that extraction makes loops of their own from them. *)
Definition walk_marked (n wide : Z) (m : tree) : bool := marked_skip m 524288 m 524288 || walk marked_skip (marked_stop n wide) 40 m m 524288 524288 0 0 0.
Definition walk_extra (s : Z) (m g : tree) : bool := extra_skip s m 524288 g 524288 || walk (extra_skip s) extra_stop 40 m g 524288 524288 0 0 0.
(** Both, one after the other or at once: the program evaluates them in two processes. *)
Definition both (a b : unit -> bool) : bool := a tt && b tt.
(** The graded mesh g, and T0; [rest] is what else there is to check. *)
Definition check_graded (t g : tree) (rest : unit -> bool) : bool :=
  let n := layer_cells c in let s := Z.shiftr 524288 (surface c) in
  let m := mark_sources s extra t g 524288 524288 0 0 0 (Also g 0 0 0 Nobody) false in
  both (fun _ => walk_marked n (Z.shiftr 2097152 below) m)
       (fun _ => (if extra then walk_extra s m g else true) && served n m 524288 524288 0 0 0 (Also m 0 0 0 Nobody) && rest tt).

Definition check_crossing (dropped : list part) (m d : tree) : bool :=
  if keep_crossing c then match dropped with [] => true | _ => false end
  else every (fun k => negb (same Cross k)) m && every (fun k => same Cross k || same Empty k) d.

Definition check_inputs : bool :=
  (0 <=? surface c) && (surface c <=? 19) && (1 <=? layer_cells c) && (layer_cells c <=? 4096).

(** What is checked early need not be kept in memory. *)
Definition check (base mesh dropped : list part) (of_base of_mesh : manifest) : bool :=
  if check_inputs then
    match build kind_of_flow base with None => false | Some t =>
    if check_counts of_base base t && check_full t then
      let t := flooded t in
      match build Cross mesh with None => false | Some m =>
      if check_counts of_mesh mesh m then
        match build Cross dropped with None => false | Some d =>
        if check_crossing dropped m d then
          match merge Cross m d 524288 with None => false | Some g =>
          check_graded t g (fun _ => check_base t && overlay (fate (negb (every (fun k => negb (same Reached k)) t))) t g)
          end
        else false end
      else false end
    else false end
  else false.
End Check.

(** The program: whether gradation is as it must be, and what it accepts. *)
From Coq Require Import ZArith List Bool.
Import ListNotations.
From Proof Require Import Statement Checker.
Open Scope Z_scope.

(** * Gradation: whether it has split what it must, and nothing else [6] *)

Definition parent (t : tree) : bool := match t with Cube _ => false | Node _ _ _ _ _ _ _ _ _ _ _ => true end.
(** The distance of cubes with edges p and q. *)
Definition far (p q x y z : Z) : Z := Z.max 0 (Z.max (apart p q x) (Z.max (apart p q y) (apart p q z))).

(** * Leaves that are near *)

(** Subtrees of one edge, with their displacements from a place. *)
Inductive around := Nobody | Also (u : tree) (x y z : Z) (rest : around).

Section Search.
(** A leaf with an edge from [lo] to [hi], a crossing one if [crossing], fewer than [reach] away from a cube of edge p. *)
Variable crossing : bool.
Variables lo hi reach p : Z.

Definition hopeless (u : tree) (q : Z) : bool := (hi <? least u q) || (most u q <? lo) || (crossing && negb (has Cross u)).
(** One in u, which has edge q and is displaced by (x, y, z). *)
Fixpoint find (u : tree) (q x y z : Z) : bool :=
  if hopeless u q || (reach <=? far p q x y z) then false else
  match u with
  | Cube _ => true
  | Node _ _ _ a b c d e f g h =>
    let q := Z.shiftr q 1 in
    find a q x y z || find b q (add x q) y z || find c q x (add y q) z || find d q (add x q) (add y q) z ||
    find e q x y (add z q) || find f q (add x q) y (add z q) || find g q x (add y q) (add z q) || find h q (add x q) (add y q) (add z q)
  end.

(** One in a list of subtrees of edge q; the cube is displaced by (x, y, z). *)
Fixpoint find_around (s : around) (q x y z : Z) : bool :=
  match s with
  | Nobody => false
  | Also u a b c rest => find u q (sub a x) (sub b y) (sub c z) || find_around rest q x y z
  end.
End Search.

Section Closer.
(** Whether a subtree may have leaves that are sought from cubes in one of edge p, and from where they are too far away. What is in no
    list is not found: this decides what is accepted, not what that means. *)
Variable useful : Z -> tree -> bool.
Variables p reach : Z.

Definition reaches (q d : Z) : bool := (sub d p <? reach) && (sub (sub 0 d) q <? reach).
Definition also (u : tree) (x y z : Z) (rest : around) : around :=
  match u with
  | Cube _ => rest
  | _ => if useful p u then if reaches p x && reaches p y && reaches p z then Also u x y z rest else rest else rest
  end.
(** The children, of edge p, of subtrees; a cube of edge p, displaced by (x, y, z), is the new place. *)
Fixpoint closer (s : around) (x y z : Z) : around :=
  match s with
  | Nobody => Nobody
  | Also u a b c rest =>
    let rest := closer rest x y z in
    match u with
    | Cube _ => rest
    | Node _ _ _ k0 k1 k2 k3 k4 k5 k6 k7 =>
      if useful p u then
        let a := sub a x in let b := sub b y in let c := sub c z in
        let a' := add a p in let b' := add b p in let c' := add c p in
        if reaches (add p p) a && reaches (add p p) b && reaches (add p p) c then
          also k0 a b c (also k1 a' b c (also k2 a b' c (also k3 a' b' c (also k4 a b c' (also k5 a' b c' (also k6 a b' c' (also k7 a' b' c' rest)))))))
        else rest
      else rest
    end
  end.
(** The list for the children of a cube of edge p, which are displaced from its corner: at the root it is that of the root itself. *)
Definition descend (s : around) (q x y z : Z) : around := if p <? q then closer s x y z else s.
End Closer.

(** * Sources *)

Section Causes.
(** Cells of a layer; the edge at the surface; whether there is an extra layer. *)
Variables n s : Z.
Variable extra : bool.

(** A cube of edge p touches leaves that are finer than its children, or is split by the extra layer. *)
Definition touched (p q x y z : Z) (near : around) : bool :=
  find_around false 1 (Z.shiftr p 2) 1 p near q x y z ||
  (extra && (s <? p) && find_around true 1 524288 1 p near q x y z).
Definition may_touch (p : Z) (u : tree) : bool := (mul 8 (least u 0) <=? p) || (extra && has Cross u).

Definition full (u : tree) : bool := match u with Cube Empty => false | _ => true end.
Definition mark_leaf (u : tree) (early : bool) : tree := match u with Cube Empty => u | _ => if early then Cube Cross else Cube Outer end.
(** The leaves of u: sources are [Cross], others are [Outer]. t is T0 there, p the edge, and [early] whether the parent was split
    before the layer that its children would make. *)
Fixpoint mark_sources (t u : tree) (p q x y z : Z) (near : around) (early : bool) : tree :=
  match u with
  | Cube _ => mark_leaf u early
  | Node _ _ _ a b c d e f g h =>
    let deeper := parent a || parent b || parent c || parent d || parent e || parent f || parent g || parent h in
    let early := parent t || deeper || touched p q x y z near in
    let w := Z.shiftr p 1 in
    if deeper then
      let near := descend may_touch p 1 near q x y z in
      join Cross w
        (mark_sources (kid false false false t) a w p 0 0 0 near early) (mark_sources (kid true false false t) b w p w 0 0 near early)
        (mark_sources (kid false true false t) c w p 0 w 0 near early) (mark_sources (kid true true false t) d w p w w 0 near early)
        (mark_sources (kid false false true t) e w p 0 0 w near early) (mark_sources (kid true false true t) f w p w 0 w near early)
        (mark_sources (kid false true true t) g w p 0 w w near early) (mark_sources (kid true true true t) h w p w w w near early)
    else if full a && full b && full c && full d && full e && full f && full g && full h then twig w early (if early then Cross else Outer)
    else join Cross w (mark_leaf a early) (mark_leaf b early) (mark_leaf c early) (mark_leaf d early)
                      (mark_leaf e early) (mark_leaf f early) (mark_leaf g early) (mark_leaf h early)
  end.

(** Whether a leaf, or a parent of leaves, has only sources. *)
Definition sources_only (t : tree) : bool :=
  match t with
  | Cube Cross => true
  | Node _ _ _ (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) => true
  | _ => false
  end.
(** A parent whose children are no sources has a source of their level fewer than n - 1 cells away. *)
Definition late (t : tree) : bool := match t with Cube Outer | Cube Reached => true | _ => false end.
Definition may_serve (p : Z) (u : tree) : bool := has Cross u && (mul 4 (least u 0) <=? p).
Fixpoint served (u : tree) (p q x y z : Z) (near : around) : bool :=
  match u with
  | Cube _ => true
  | Node _ _ _ a b c d e f g h =>
    let w := Z.shiftr p 1 in
    (if late a || late b || late c || late d || late e || late f || late g || late h
     then find_around true w w (mul (sub n 1) w) p near q x y z else true) &&
    (if sources_only a && sources_only b && sources_only c && sources_only d && sources_only e && sources_only f && sources_only g && sources_only h then true else
     if parent a || parent b || parent c || parent d || parent e || parent f || parent g || parent h then
       let near := descend may_serve p (Z.shiftr (add (mul (sub n 1) p) 3) 2) near q x y z in
       served a w p 0 0 0 near && served b w p w 0 0 near && served c w p 0 w 0 near && served d w p w w 0 near &&
       served e w p 0 0 w near && served f w p w 0 w near && served g w p 0 w w near && served h w p w w w near
     else true)
  end.

(** * Pairs of leaves, marked *)

(** A leaf that is coarser than a source is n - 1 cells away from it. *)
Definition source_stop (t : tree) (p : Z) (u : tree) (q d : Z) : bool :=
  negb (has Cross u) || (mul (sub n 1) (Z.min (most u q) (Z.shiftr (most t p) 1)) <=? d).
Definition marked_skip (t : tree) (p : Z) (u : tree) (q : Z) : bool := most t p <=? least u q.
(** Both, that a leaf that is no source touches no finer leaf, and the rules of [graded_stop]. All of them concern a leaf and finer ones. *)
Definition marked_stop (wide : Z) (t : tree) (p : Z) (u : tree) (q d : Z) : bool :=
  graded_stop n wide t p u q d && ((0 <? d) || sources_only t) && source_stop t p u q d.
(** A leaf that is coarser than the surface, or as coarse and no source, touches no crossing leaf. *)
Definition extra_skip (t : tree) (p : Z) (u : tree) (q : Z) : bool :=
  (match t with Cube Cross => p <=? s | _ => most t p <? s end) || negb (has Cross u).
Definition extra_stop (t : tree) (p : Z) (u : tree) (q d : Z) : bool := 0 <? d.
End Causes.

(** * What the program accepts *)

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

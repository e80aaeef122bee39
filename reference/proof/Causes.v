(** The program: whether gradation has split what it must, and nothing else [6]. *)
From Coq Require Import ZArith List Bool.
From Proof Require Import Statement Checker.
Open Scope Z_scope.

Definition parent (t : tree) : bool := match t with Cube _ => false | Node _ _ _ _ _ _ _ _ _ _ _ => true end.
(** The distance of cubes with edges p and q. *)
Definition far (p q x y z : Z) : Z := Z.max 0 (Z.max (apart p q x) (Z.max (apart p q y) (apart p q z))).

(** * Leaves that are near *)

(** Subtrees of one edge, with their displacements from a place. *)
Inductive around := Nobody | Also (u : tree) (x y z : Z) (rest : around).

Section Search.
(** A leaf of a wanted kind, with an edge from [lo] to [hi], fewer than [reach] away from a cube of edge p. *)
Variable wanted : tree -> bool.
Variables lo hi reach p : Z.

(** One in u, which has edge q and is displaced by (x, y, z). *)
Fixpoint find (u : tree) (q x y z : Z) : bool :=
  if (reach <=? far p q x y z) || (hi <? least u q) || (most u q <? lo) || negb (wanted u) then false else
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
(** Whether a subtree of edge q, at a distance d, may have leaves that are sought from cubes in one of edge p. *)
Variable useful : Z -> tree -> Z -> Z -> bool.
Variable p : Z.

Definition also (u : tree) (x y z : Z) (rest : around) : around :=
  if parent u && useful p u p (far p p x y z) then Also u x y z rest else rest.
(** The children, of edge p, of subtrees; a cube of edge p, displaced by (x, y, z), is the new place. *)
Fixpoint closer (s : around) (x y z : Z) : around :=
  match s with
  | Nobody => Nobody
  | Also u a b c rest =>
    let rest := closer rest x y z in
    match u with
    | Cube _ => rest
    | Node _ _ _ k0 k1 k2 k3 k4 k5 k6 k7 =>
      let a := sub a x in let b := sub b y in let c := sub c z in
      let a' := add a p in let b' := add b p in let c' := add c p in
      if useful p u p (far p (add p p) a b c) then
        also k0 a b c (also k1 a' b c (also k2 a b' c (also k3 a' b' c (also k4 a b c' (also k5 a' b c' (also k6 a b' c' (also k7 a' b' c' rest)))))))
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

Definition any_kind (u : tree) : bool := true.
(** A cube of edge p touches leaves that are finer than its children, or is split by the extra layer. *)
Definition touched (p q x y z : Z) (near : around) : bool :=
  find_around any_kind 1 (Z.shiftr p 2) 1 p near q x y z ||
  (extra && (s <? p) && find_around (has Cross) 1 524288 1 p near q x y z).
Definition may_touch (p : Z) (u : tree) (q d : Z) : bool := (d <=? 0) && ((mul 8 (least u q) <=? p) || (extra && has Cross u)).

(** The leaves of u: sources are [Cross], others are [Outer]. t is T0 there, p the edge, and [early] whether the parent was split
    before the layer that its children would make. *)
Fixpoint mark_sources (t u : tree) (p q x y z : Z) (near : around) (early : bool) : tree :=
  match u with
  | Cube Empty => u
  | Cube _ => if early then Cube Cross else Cube Outer
  | Node _ _ _ a b c d e f g h =>
    let deeper := parent a || parent b || parent c || parent d || parent e || parent f || parent g || parent h in
    let early := parent t || deeper || touched p q x y z near in
    let near := if deeper then descend may_touch p near q x y z else Nobody in
    let z := Z.shiftr p 1 in
    share (join Cross z
      (mark_sources (kid false false false t) a z p 0 0 0 near early) (mark_sources (kid true false false t) b z p z 0 0 near early)
      (mark_sources (kid false true false t) c z p 0 z 0 near early) (mark_sources (kid true true false t) d z p z z 0 near early)
      (mark_sources (kid false false true t) e z p 0 0 z near early) (mark_sources (kid true false true t) f z p z 0 z near early)
      (mark_sources (kid false true true t) g z p 0 z z near early) (mark_sources (kid true true true t) h z p z z z near early))
  end.

(** A parent whose children are no sources has a source of their level fewer than n - 1 cells away. *)
Definition late (t : tree) : bool := match t with Cube Outer | Cube Reached => true | _ => false end.
Definition may_serve (p : Z) (u : tree) (q d : Z) : bool :=
  has Cross u && (mul 4 (least u q) <=? p) && (mul 4 d <? mul (sub n 1) p).
Fixpoint served (u : tree) (p q x y z : Z) (near : around) : bool :=
  match u with
  | Cube _ => true
  | Node _ _ _ a b c d e f g h =>
    let w := Z.shiftr p 1 in
    (if late a || late b || late c || late d || late e || late f || late g || late h
     then find_around (has Cross) w w (mul (sub n 1) w) p near q x y z else true) &&
    (if parent a || parent b || parent c || parent d || parent e || parent f || parent g || parent h then
       let near := descend may_serve p near q x y z in
       served a w p 0 0 0 near && served b w p w 0 0 near && served c w p 0 w 0 near && served d w p w w 0 near &&
       served e w p 0 0 w near && served f w p w 0 w near && served g w p 0 w w near && served h w p w w w near
     else true)
  end.

(** * Pairs of leaves, marked *)

(** A leaf that is no source touches no finer leaf. *)
Definition sources_only (t : tree) : bool :=
  match t with
  | Cube Cross => true
  | Node _ _ _ (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) (Cube Cross) => true
  | _ => false
  end.
(** A leaf that is coarser than a source is n - 1 cells away from it. *)
Definition source_stop (t : tree) (p : Z) (u : tree) (q d : Z) : bool :=
  negb (has Cross u) || (mul (sub n 1) (Z.min (most u q) (Z.shiftr (most t p) 1)) <=? d).
(** Both, and those of [graded_stop]. All of them concern a leaf and finer ones. *)
Definition marked_stop (wide : Z) (t : tree) (p : Z) (u : tree) (q d : Z) : bool :=
  if most t p <=? least u q then true else
  graded_stop n wide t p u q d && ((0 <? d) || sources_only t) && source_stop t p u q d.
(** A leaf that is coarser than the surface, or as coarse and no source, touches no crossing leaf. *)
Definition extra_stop (t : tree) (p : Z) (u : tree) (q d : Z) : bool :=
  (match t with Cube Cross => p <=? s | _ => most t p <? s end) || negb (has Cross u) || (0 <? d).
End Causes.

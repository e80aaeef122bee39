(** Definitions of Statement.v that a reader may doubt: its distance is that of the points of two closed cubes, and its side of a
    word is the one of section 8. *)
From Coq Require Import ZArith Lia.
From Proof Require Import Statement.
Open Scope Z_scope.

Definition point (a : leaf) (x y z : Z) : Prop :=
  cx a <= x <= cx a + edge a /\ cy a <= y <= cy a + edge a /\ cz a <= z <= cz a + edge a.
Lemma gap_least x e x' e' p q : x <= p <= x + e -> x' <= q <= x' + e' -> gap x e x' e' <= Z.abs (p - q).
Proof. unfold gap. lia. Qed.
Lemma gap_reached x e x' e' : 0 <= e -> 0 <= e' -> exists p q, x <= p <= x + e /\ x' <= q <= x' + e' /\ gap x e x' e' = Z.abs (p - q).
Proof.
  intros. unfold gap. destruct (Z_le_dec (x + e) x').
  - exists (x + e), x'. lia.
  - destruct (Z_le_dec (x' + e') x).
    + exists x, (x' + e'). lia.
    + exists (Z.max x x'), (Z.max x x'). lia.
Qed.
Lemma distance_least a b x y z x' y' z' : point a x y z -> point b x' y' z' ->
  distance a b <= Z.max (Z.abs (x - x')) (Z.max (Z.abs (y - y')) (Z.abs (z - z'))).
Proof.
  intros (A & B & C) (D & E & F). unfold distance.
  pose proof (gap_least _ _ _ _ _ _ A D). pose proof (gap_least _ _ _ _ _ _ B E). pose proof (gap_least _ _ _ _ _ _ C F). lia.
Qed.
Lemma distance_reached a b : 0 <= edge a -> 0 <= edge b -> exists x y z x' y' z', point a x y z /\ point b x' y' z' /\
  distance a b = Z.max (Z.abs (x - x')) (Z.max (Z.abs (y - y')) (Z.abs (z - z'))).
Proof.
  intros P Q. unfold distance, point.
  destruct (gap_reached (cx a) _ (cx b) _ P Q) as (p & q & A & B & ->).
  destruct (gap_reached (cy a) _ (cy b) _ P Q) as (r & s & C & D & ->).
  destruct (gap_reached (cz a) _ (cz b) _ P Q) as (t & u & E & F & ->).
  exists p, r, t, q, s, u. repeat split; lia.
Qed.

Lemma sides_of_codes l : side_of_code (l * 4) = Outside /\ side_of_code (l * 4 + 1) = Inside /\ side_of_code (l * 4 + 2) = Crossing.
Proof.
  unfold side_of_code. rewrite Z.mod_mul by lia. replace ((l * 4 + 1) mod 4) with 1 by (Z.to_euclidean_division_equations; lia).
  replace ((l * 4 + 2) mod 4) with 2 by (Z.to_euclidean_division_equations; lia). auto.
Qed.

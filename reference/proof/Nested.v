(** Octants: two of them are nested or disjoint, and each has a parent. *)
From Coq Require Import ZArith List Lia.
Import ListNotations.
From Proof Require Import Statement.
Open Scope Z_scope.

Lemma cells_pos l : l <= 19 -> 0 < cells l.
Proof. intros. apply Z.pow_pos_nonneg; lia. Qed.
Lemma edge_pos a : octant a -> 0 < edge a.
Proof. intros [L _]. apply cells_pos. lia. Qed.
Lemma cells_divide l m : 0 <= l -> l <= m <= 19 -> (cells m | cells l).
Proof.
  intros A B. exists (2 ^ (m - l)). unfold cells. rewrite <- Z.pow_add_r by lia. f_equal. lia.
Qed.
Lemma cells_double l : l <= 18 -> cells l = 2 * cells (l + 1).
Proof. intros. unfold cells. rewrite <- Z.pow_succ_r by lia. f_equal. lia. Qed.
Lemma cells_less l m : l < m -> m <= 19 -> 2 * cells m <= cells l.
Proof. intros. unfold cells. rewrite <- Z.pow_succ_r by lia. apply Z.pow_le_mono_r; lia. Qed.
Lemma cells_antitone l m : l <= m -> cells m <= cells l.
Proof. intros. unfold cells. destruct (Z_le_dec m 19); [apply Z.pow_le_mono_r; lia|]. rewrite (Z.pow_neg_r 2 (19 - m)) by lia. apply Z.pow_nonneg. lia. Qed.

Lemma corner_holds a : octant a -> holds a (cx a) (cy a) (cz a).
Proof. intros O. apply edge_pos in O. unfold holds. lia. Qed.
Lemma octant_bounds a : octant a -> (0 <= cx a /\ cx a + edge a <= 524288) /\ (0 <= cy a /\ cy a + edge a <= 524288) /\
  (0 <= cz a /\ cz a + edge a <= 524288).
Proof.
  intros O. pose proof (edge_pos a O). destruct O as (_ & _ & _ & _ & I).
  assert (in_root (cx a) (cy a) (cz a)) as A by (apply I; unfold holds; lia).
  assert (in_root (cx a + edge a - 1) (cy a + edge a - 1) (cz a + edge a - 1)) as B by (apply I; unfold holds; lia).
  unfold in_root in A, B. replace (cells 0) with 524288 in A, B by reflexivity. lia.
Qed.
Lemma octant_in a u v w : octant a -> holds a u v w -> in_root u v w.
Proof. intros (_ & _ & _ & _ & I). apply I. Qed.

Lemma axis_nested p e q f u : 0 < f -> (f | e) -> (e | p) -> (f | q) -> p <= u < p + e -> q <= u < q + f -> p <= q /\ q + f <= p + e.
Proof.
  intros F [k K] [i I] [j J] P Q. subst e p q.
  assert (i * (k * f) = (i * k) * f) as R by ring. rewrite R in *.
  assert (i * k * f + k * f = (i * k + k) * f) as R' by ring. rewrite R' in *.
  assert (j * f + f = (j + 1) * f) as R'' by ring. rewrite R'' in *.
  assert (i * k < j + 1) by nia. assert (j < i * k + k) by nia. nia.
Qed.

(** Of octants with a common cell, the finer lies in the other. *)
Lemma nested_bounds a b u v w : octant a -> octant b -> level a <= level b -> holds a u v w -> holds b u v w ->
  (cx a <= cx b /\ cx b + edge b <= cx a + edge a) /\ (cy a <= cy b /\ cy b + edge b <= cy a + edge a) /\
  (cz a <= cz b /\ cz b + edge b <= cz a + edge a).
Proof.
  intros OA OB L (AX & AY & AZ) (BX & BY & BZ). pose proof (edge_pos b OB).
  destruct OA as (LA & DX & DY & DZ & _), OB as (LB & EX & EY & EZ & _).
  assert (edge b | edge a) as D by (apply cells_divide; lia).
  split; [|split]; eapply axis_nested; eassumption.
Qed.
Lemma nested a b u v w : octant a -> octant b -> level a <= level b -> holds a u v w -> holds b u v w -> within b a.
Proof.
  intros OA OB L A B. pose proof (nested_bounds a b u v w OA OB L A B). intros x y z. unfold holds. lia.
Qed.
Lemma within_bounds a b : octant a -> within a b ->
  (cx b <= cx a /\ cx a + edge a <= cx b + edge b) /\ (cy b <= cy a /\ cy a + edge a <= cy b + edge b) /\
  (cz b <= cz a /\ cz a + edge a <= cz b + edge b).
Proof.
  intros O W. pose proof (edge_pos a O).
  assert (holds b (cx a) (cy a) (cz a)) as A by (apply W, corner_holds; exact O).
  assert (holds b (cx a + edge a - 1) (cy a + edge a - 1) (cz a + edge a - 1)) as B by (apply W; unfold holds; lia).
  unfold holds in A, B. lia.
Qed.
Lemma within_level a b : octant a -> within a b -> level b <= level a.
Proof.
  intros O W. pose proof (within_bounds a b O W) as B. destruct O as (L & _).
  destruct (Z_le_dec (level b) (level a)) as [|N]; [assumption|]. exfalso.
  destruct (Z_le_dec (level b) 19) as [M|M].
  - pose proof (cells_less (level a) (level b)). pose proof (cells_pos (level b) M). unfold edge in B. lia.
  - pose proof (cells_pos (level a)). assert (cells (level b) = 0) by (unfold cells; apply Z.pow_neg_r; lia). unfold edge in B. lia.
Qed.
Lemma same_level_cube a b u v w : octant a -> octant b -> level a = level b -> holds a u v w -> holds b u v w ->
  cx a = cx b /\ cy a = cy b /\ cz a = cz b.
Proof.
  intros OA OB L A B. pose proof (nested_bounds a b u v w OA OB ltac:(lia) A B).
  pose proof (nested_bounds b a u v w OB OA ltac:(lia) B A). lia.
Qed.

(** The parent. *)
Definition parent_of (a : leaf) : leaf := let e := 2 * edge a in
  Leaf (e * (cx a / e)) (e * (cy a / e)) (e * (cz a / e)) (level a - 1) (side_of a).
Lemma axis_parent p f : 0 < f -> (f | p) -> let q := 2 * f * (p / (2 * f)) in q <= p /\ p + f <= q + 2 * f.
Proof.
  intros F [i ->] q. subst q. rewrite Z.div_mul_cancel_r by lia.
  pose proof (Z.div_mod i 2). pose proof (Z.mod_pos_bound i 2). nia.
Qed.
Lemma parent_of_edge a : octant a -> 1 <= level a -> edge (parent_of a) = 2 * edge a.
Proof.
  intros (L & _) P. unfold edge. cbn [level parent_of]. rewrite (cells_double (level a - 1)) by lia. do 2 f_equal. lia.
Qed.
Lemma parent_octant a : octant a -> 1 <= level a -> octant (parent_of a) /\ within a (parent_of a).
Proof.
  intros O P. pose proof (parent_of_edge a O P) as EQ. pose proof (edge_pos a O) as EP. pose proof (octant_bounds a O) as B.
  destruct O as (L & DX & DY & DZ & _).
  pose proof (axis_parent _ _ EP DX) as PX. pose proof (axis_parent _ _ EP DY) as PY. pose proof (axis_parent _ _ EP DZ) as PZ.
  assert (2 * edge a | 524288) as DR.
  { replace (2 * edge a) with (cells (level a - 1)) by (rewrite <- EQ; reflexivity). replace 524288 with (cells 0) by reflexivity. apply cells_divide; lia. }
  assert (forall p, 0 <= p -> p + edge a <= 524288 -> 0 <= 2 * edge a * (p / (2 * edge a)) /\
    2 * edge a * (p / (2 * edge a)) + 2 * edge a <= 524288) as R.
  { intros p P0 P1. pose proof (Z.mul_div_le p (2 * edge a)). pose proof (Z.div_pos p (2 * edge a)).
    assert (p < 2 * edge a * (p / (2 * edge a)) + 2 * edge a) by (pose proof (Z.mod_pos_bound p (2 * edge a)); pose proof (Z.div_mod p (2 * edge a)); lia).
    split; [nia|]. apply (axis_nested 0 524288 _ (2 * edge a) p); try lia; trivial; [apply Z.divide_0_r | apply Z.divide_factor_l]. }
  destruct B as ([X0 X1] & [Y0 Y1] & [Z0 Z1]).
  pose proof (R _ X0 X1) as RX. pose proof (R _ Y0 Y1) as RY. pose proof (R _ Z0 Z1) as RZ. clear R DR. cbv zeta in *.
  split.
  - unfold octant. rewrite EQ. cbn [cx cy cz level parent_of]. split; [lia|]. do 3 (split; [apply Z.divide_factor_l|]).
    intros u v w (U & V & W). rewrite EQ in U, V, W. cbn [cx cy cz parent_of] in U, V, W.
    unfold in_root. replace (cells 0) with 524288 by reflexivity. clear EQ DX DY DZ.
    set (e := edge a) in *. clearbody e. lia.
  - intros u v w (U & V & W). unfold holds. rewrite EQ. cbn [cx cy cz parent_of]. clear EQ DX DY DZ RX RY RZ.
    set (e := edge a) in *. clearbody e. lia.
Qed.

(** Distance. *)
Lemma gap_within p e p' e' q f : p' <= p /\ p + e <= p' + e' -> gap p' e' q f <= gap p e q f.
Proof. unfold gap. lia. Qed.
Lemma gap_common p e q f u : p <= u < p + e -> q <= u < q + f -> gap p e q f = 0.
Proof. unfold gap. lia. Qed.
Lemma distance_within a b o : octant a -> within a b -> distance b o <= distance a o.
Proof.
  intros O W. destruct (within_bounds a b O W) as (X & Y & Z'). unfold distance.
  apply Z.max_le_compat; [apply gap_within; exact X | apply Z.max_le_compat; apply gap_within; assumption].
Qed.
Lemma distance_comm a b : distance a b = distance b a.
Proof.
  assert (forall x e y f, gap x e y f = gap y f x e) as G by (intros; unfold gap; f_equal; apply Z.max_comm).
  unfold distance. rewrite (G (cx a)), (G (cy a)), (G (cz a)). reflexivity.
Qed.
Lemma distance_nonneg a b : 0 <= distance a b.
Proof. unfold distance. apply Z.max_le_iff. left. apply Z.le_max_l. Qed.
Lemma touch_within a b o : octant a -> within a b -> touch a o -> touch b o.
Proof. unfold touch. intros O W T. pose proof (distance_within a b o O W). pose proof (distance_nonneg b o). lia. Qed.
Lemma common_touch a b u v w : holds a u v w -> holds b u v w -> touch a b.
Proof.
  intros (X & Y & Z') (P & Q & R). unfold touch, distance. rewrite (gap_common _ _ _ _ _ X P), (gap_common _ _ _ _ _ Y Q), (gap_common _ _ _ _ _ Z' R). reflexivity.
Qed.
Lemma inside_touch a o : octant a -> inside a o -> touch a o.
Proof. intros O [W _]. pose proof (corner_holds a O) as C. exact (common_touch a o _ _ _ C (W _ _ _ C)). Qed.

Lemma pairs_disjoint a b l : ForallOrdPairs disjoint l -> In a l -> In b l -> forall u v w, holds a u v w -> holds b u v w -> a = b.
Proof.
  intros F A B u v w P Q. destruct (ForallOrdPairs_In F a b A B) as [E' | [D | D]]; [exact E' | destruct (D u v w P Q) | destruct (D u v w Q P)].
Qed.

(** What follows from Statement.v alone, without the program. Octants are nested or disjoint. There is one mesh: two that are least for one
    T0 have the same leaves; balance and the cells near crossing leaves are consequences of leastness, too. And definitions that a
    reader may doubt: the distance is that of the points of two closed cubes, and the side of a word is the one of section 8. *)
From Coq Require Import ZArith List Lia Permutation Relations.
Import ListNotations.
From Proof Require Import Statement.
Open Scope Z_scope.

(** * Octants: two of them are nested or disjoint, and each has a parent *)

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

(** * There is one mesh *)

(** What [promised] has of the kept region. *)
Definition region (c : inputs) (base mesh dropped : list leaf) : Prop :=
  tiles base /\ linear (mesh ++ dropped) /\ complete c base mesh dropped /\ inherits c base mesh dropped.

Section Graded.
Variable c : inputs.
Variables base mesh dropped : list leaf.
Let graded := mesh ++ dropped.
Hypothesis G : region c base mesh dropped.

Lemma base_octant b : In b base -> octant b.
Proof. destruct G as (([O _] & _) & _). apply O. Qed.
Lemma base_one a b u v w : In a base -> In b base -> holds a u v w -> holds b u v w -> a = b.
Proof. destruct G as (([_ F] & _) & _). intros. eapply pairs_disjoint; eassumption. Qed.
Lemma graded_octant a : In a graded -> octant a.
Proof. destruct G as (_ & [O _] & _). apply O. Qed.
Lemma graded_one a b u v w : In a graded -> In b graded -> holds a u v w -> holds b u v w -> a = b.
Proof. destruct G as (_ & [_ F] & _). intros. eapply pairs_disjoint; eassumption. Qed.

(** A graded leaf is not split. *)
Lemma not_split a : In a graded -> ~ split mesh dropped a.
Proof.
  intros A (p & P & W & L). pose proof (corner_holds p (graded_octant p P)) as C.
  rewrite (graded_one a p _ _ _ A P (W _ _ _ C) C) in L. lia.
Qed.
(** The leaf of T0 in which a graded leaf lies. *)
Lemma home a : In a graded -> exists b, In b base /\ ~ deleted c base b /\ within a b /\ side_of a = side_of b /\ level b <= level a.
Proof.
  intros A. destruct G as (_ & _ & _ & I). destruct (I a A) as (b & B & W & S & N). exists b.
  split; [exact B|]. split; [exact N|]. split; [exact W|]. split; [exact S|]. apply within_level; [apply graded_octant; exact A | exact W].
Qed.
(** The graded leaf at a place in a leaf of T0 that is kept. *)
Lemma filled_by b u v w : In b base -> ~ deleted c base b -> holds b u v w -> exists a, In a graded /\ holds a u v w /\ within a b /\ side_of a = side_of b.
Proof.
  intros B N H. destruct G as (_ & _ & C & _). pose proof (octant_in b u v w (base_octant b B) H) as IR.
  destruct (C u v w IR) as [(a & A & HA) | (b' & B' & D & H')].
  - exists a. split; [exact A|]. split; [exact HA|]. destruct (home a A) as (b' & B' & _ & W & S & _).
    assert (b' = b) as -> by (apply (base_one b' b u v w B' B (W _ _ _ HA) H)). auto.
  - exfalso. apply N. rewrite <- (base_one b' b u v w B' B H' H). exact D.
Qed.

(** A parent lies in the leaf of T0, or T0 has the leaf itself. *)
Lemma parent_home a b q : In a graded -> In b base -> within a b -> octant q -> level q = level a - 1 -> within a q ->
  within q b \/ level b = level a /\ inside b q.
Proof.
  intros A B W O L WQ. pose proof (corner_holds a (graded_octant a A)) as C.
  pose proof (within_level a b (graded_octant a A) W). destruct (Z_le_dec (level b) (level q)) as [LE|LE].
  - left. exact (nested b q _ _ _ (base_octant b B) O LE (W _ _ _ C) (WQ _ _ _ C)).
  - right. split; [lia|]. split; [|lia]. eapply (nested q b _ _ _ O (base_octant b B)); [lia | exact (WQ _ _ _ C) | exact (W _ _ _ C)].
Qed.

(** An octant of the kept region is a leaf if it is not split and its parent is, or T0 has it. *)
Lemma is_leaf a b q : octant a -> In b base -> ~ deleted c base b -> within a b -> side_of a = side_of b -> ~ split mesh dropped a ->
  level b = level a \/ within a q /\ level q = level a - 1 /\ octant q /\ split mesh dropped q -> In a graded.
Proof.
  intros O B N W S NS Q. pose proof (corner_holds a O) as C. destruct (filled_by b _ _ _ B N (W _ _ _ C)) as (p & P & HP & WP & SP).
  pose proof (graded_octant p P) as OP.
  destruct (Z_lt_dec (level a) (level p)) as [L|L].
  { exfalso. apply NS. exists p. split; [exact P|]. split; [|exact L]. eapply (nested a p _ _ _ O OP); [lia | exact C | exact HP]. }
  assert (level p = level a) as E.
  { destruct Q as [E | (WQ & LQ & OQ & (r & R & WR & LR))].
    - pose proof (within_level p b OP WP). lia.
    - destruct (Z.eq_dec (level p) (level a)); [assumption|]. exfalso.
      assert (within q p) as QP by (eapply (nested p q _ _ _ OP OQ); [lia | exact HP | exact (WQ _ _ _ C)]).
      pose proof (corner_holds r (graded_octant r R)) as CR.
      rewrite (graded_one r p _ _ _ R P CR (QP _ _ _ (WR _ _ _ CR))) in LR. lia. }
  destruct (same_level_cube p a _ _ _ OP O E HP C) as (X & Y & Z').
  assert (p = a) as <-; [|exact P]. destruct p, a; cbn in *. congruence.
Qed.
End Graded.

(** Two meshes of one T0. Splits at a level depend on those at finer levels only. *)
Section Two.
Variable c : inputs.
Variable base : list leaf.
Definition agree l m d m' d' := forall o b, octant o -> In b base -> ~ deleted c base b -> within o b -> l < level o ->
  (split m d o <-> split m' d' o).

Lemma carry_leaf m d m' d' l a : region c base m d -> region c base m' d' -> agree l m d m' d' -> In a (m ++ d) ->
  (forall q, octant q -> level q = level a - 1 -> within a q -> (exists b, In b base /\ ~ deleted c base b /\ within q b) -> split m d q -> split m' d' q) ->
  l < level a -> In a (m' ++ d').
Proof.
  intros G G' A IA SP L. pose proof (graded_octant c base m d G a IA) as O.
  destruct (home c base m d G a IA) as (b & B & N & W & S & LB).
  assert (~ split m' d' a) as NS by (intros Q; apply (A a b O B N W L) in Q; exact (not_split c base m d G a IA Q)).
  destruct (Z.eq_dec (level b) (level a)) as [E|E].
  - exact (is_leaf c base m' d' G' a b a O B N W S NS (or_introl E)).
  - pose proof (proj1 (base_octant c base m d G b B)) as LB'. assert (1 <= level a) as L1 by lia.
    destruct (parent_octant a O L1) as [OQ WQ]. set (q := parent_of a) in *. assert (level q = level a - 1) as LQ by reflexivity.
    apply (is_leaf c base m' d' G' a b q O B N W S NS). right. split; [exact WQ|]. split; [exact LQ|]. split; [exact OQ|].
    destruct (parent_home c base m d G a b q IA B W OQ LQ WQ) as [WB | [? _]]; [|lia].
    apply SP; trivial; [exists b; auto|]. exists a. split; [exact IA|]. split; [exact WQ | lia].
Qed.

Lemma carry_early m d m' d' o : region c base m d -> region c base m' d' -> agree (level o) m d m' d' ->
  split_early c base m d o -> split_early c base m' d' o.
Proof.
  intros G G' A [T | [(a & IA & L & T) | X]]; [left; exact T | | right; right; exact X].
  right; left. exists a. split; [|auto]. apply (carry_leaf m d m' d' (level o) a G G' A IA); [|lia].
  intros q OQ LQ WQ (b & B & N & W) S. apply (A q b OQ B N W); [lia | exact S].
Qed.

Lemma carry_layer m d m' d' o : region c base m d -> region c base m' d' -> least c base m' d' -> agree (level o) m d m' d' ->
  in_layer c base m d o -> in_layer c base m' d' o.
Proof.
  intros G G' LE A (p & (IP & q & OQ & LQ & WQ & EQ) & LP & D). exists p. split; [|auto].
  assert (level q = level o) as LO by lia.
  assert (split_early c base m' d' q) as EQ' by (apply (carry_early m d m' d' q G G'); [rewrite LO; exact A | exact EQ]).
  split; [|exists q; auto]. apply (carry_leaf m d m' d' (level o) p G G' A IP); [|lia].
  intros r OR LR WR (b & B & N & W) _.
  pose proof (corner_holds p (graded_octant c base m d G p IP)) as C.
  destruct (same_level_cube r q _ _ _ OR OQ ltac:(lia) (WR _ _ _ C) (WQ _ _ _ C)) as (X & Y & Z').
  assert (within q b) as WB.
  { intros u v w H. apply W. unfold holds, edge in *. rewrite LR, X, Y, Z'. rewrite LQ in H. exact H. }
  assert (split m' d' q) as (s & S & [WS LS]) by (apply (LE q b OQ B N WB); left; exact EQ').
  exists s. split; [exact S|]. split; [|lia].
  intros u v w H. apply WS in H. unfold holds, edge in *. rewrite LR, X, Y, Z'. rewrite LQ in H. exact H.
Qed.

Lemma all_agree m d m' d' : region c base m d -> region c base m' d' -> least c base m d -> least c base m' d' -> forall k : nat, agree (19 - Z.of_nat k) m d m' d'.
Proof.
  intros G G' LE LE'. induction k as [| k IH]; intros o b O B N W L.
  - destruct O as (LO & _). lia.
  - destruct (Z.eq_dec (level o) (19 - Z.of_nat k)) as [E|E]; [|apply (IH o b O B N W); lia].
    rewrite <- E in IH. assert (agree (level o) m' d' m d) as IH' by (intros p b' ? ? ? ? ?; symmetry; apply (IH p b'); assumption).
    rewrite (LE o b O B N W), (LE' o b O B N W). split; (intros [H | H]; [left | right]).
    + exact (carry_early m d m' d' o G G' IH H).
    + exact (carry_layer m d m' d' o G G' LE' IH H).
    + exact (carry_early m' d' m d o G' G IH' H).
    + exact (carry_layer m' d' m d o G' G LE IH' H).
Qed.

(** Two least meshes of one T0 have the same leaves. *)
Theorem unique m d m' d' : region c base m d -> region c base m' d' -> least c base m d -> least c base m' d' -> forall a, In a (m ++ d) -> In a (m' ++ d').
Proof.
  intros G G' LE LE' a A. apply (carry_leaf m d m' d' (-1) a G G'); trivial.
  - exact (all_agree m d m' d' G G' LE LE' 20%nat).
  - intros q OQ LQ WQ (b & B & N & W) S. apply (all_agree m d m' d' G G' LE LE' 20%nat q b OQ B N W); [|exact S]. destruct OQ as [? _]. cbn. lia.
  - destruct (graded_octant c base m d G a A) as [? _]. lia.
Qed.
End Two.

(** * Corollaries for what [promised] has *)

Lemma disjoint_nodup l : linear l -> NoDup l.
Proof.
  intros [O F]. induction F as [| a l P F IH]; constructor.
  - intros I. rewrite Forall_forall in P. pose proof (corner_holds a (O a (or_introl eq_refl))) as C. exact (P a I _ _ _ C C).
  - apply IH. intros b B. apply O. right. exact B.
Qed.
Lemma linear_app l m : linear (l ++ m) -> linear l.
Proof.
  intros [O F]. split; [intros a A; apply O, in_or_app; left; exact A|]. clear O. induction l as [| a l IH]; [constructor|].
  cbn [app] in F. inversion F as [| ? ? P Q]; subst. constructor; [|apply IH; exact Q].
  rewrite Forall_forall in *. intros b B. apply P, in_or_app. left. exact B.
Qed.
Lemma mesh_of_graded c m d : without_crossing c m d -> forall a, In a m <-> In a (m ++ d) /\ (keep_crossing c = false -> side_of a <> Crossing).
Proof.
  unfold without_crossing. intros W a. rewrite in_app_iff. destruct (keep_crossing c).
  - subst d. split; [intros A; split; [left; exact A | discriminate] | intros [[A | []] _]; exact A].
  - destruct W as [WM WD]. split; [intros A; auto|]. intros [[A | A] N]; [exact A|]. destruct (N eq_refl (WD a A)).
Qed.

(** Two meshes of one T0 have the same leaves, in however many parts, whatever is offered as [dropped]. *)
Theorem promised_equal c base m d m' d' of_base of_m of_m' : promised c base m d of_base of_m -> promised c base m' d' of_base of_m' ->
  Permutation (leaves m) (leaves m').
Proof.
  intros (_ & _ & _ & T & _ & _ & _ & L & W & C & I & LE & _) (_ & _ & _ & _ & _ & _ & _ & L' & W' & C' & I' & LE' & _).
  assert (region c (leaves base) (leaves m) (leaves d)) as G by (split; auto).
  assert (region c (leaves base) (leaves m') (leaves d')) as G' by (split; auto).
  apply NoDup_Permutation; [exact (disjoint_nodup _ (linear_app _ _ L)) | exact (disjoint_nodup _ (linear_app _ _ L'))|].
  intros a. rewrite (mesh_of_graded c _ _ W), (mesh_of_graded c _ _ W').
  pose proof (unique c (leaves base) _ _ _ _ G G' LE LE' a). pose proof (unique c (leaves base) _ _ _ _ G' G LE' LE a). tauto.
Qed.

(** Balance. *)
Theorem least_balanced c base m d : region c base m d -> least c base m d -> balanced m d.
Proof.
  intros G LE. assert (forall a b, In a (m ++ d) -> In b (m ++ d) -> touch a b -> level a <= level b + 1) as ONE.
  { intros a b A B T. destruct (Z_le_dec (level a) (level b + 1)) as [|N]; [assumption|]. exfalso.
    destruct (home c base m d G b B) as (b0 & B0 & ND & W & _). apply (not_split c base m d G b B).
    apply (LE b b0 (graded_octant c base m d G b B) B0 ND W). left; right; left. exists a. split; [exact A|]. split; [lia | exact T]. }
  intros a b A B T. pose proof (ONE a b A B T). unfold touch in T. rewrite distance_comm in T. pose proof (ONE b a B A T). lia.
Qed.

(** The octant of the level above that of p, in a coarser octant, that is nearest to p. *)
Lemma axis_nearest p f x e : 0 < f -> (2 * f | e) -> 0 < e -> (f | p) -> (e | x) -> exists y, (2 * f | y) /\ x <= y /\ y + 2 * f <= x + e /\
  gap p f y (2 * f) = gap p f x e.
Proof.
  intros F [k K] P [i I] [j J]. assert (1 <= k) by nia.
  assert (2 * f * (p / (2 * f)) <= p < 2 * f * (p / (2 * f)) + 2 * f) as D by (pose proof (Z.div_mod p (2 * f)); pose proof (Z.mod_pos_bound p (2 * f)); lia).
  assert (p + f <= 2 * f * (p / (2 * f)) + 2 * f) as D' by (apply (axis_parent p f F); exists i; exact I).
  set (q := p / (2 * f)) in *.
  exists (Z.max x (Z.min (x + e - 2 * f) (2 * f * q))). split; [|].
  - assert (x = 2 * f * (j * k)) as X by (rewrite J, K; ring). rewrite K, X.
    replace (2 * f * (j * k) + k * (2 * f) - 2 * f) with (2 * f * (j * k + k - 1)) by ring.
    apply Z.max_case; [apply Z.divide_factor_l | apply Z.min_case; apply Z.divide_factor_l].
  - assert (2 * f <= e) by nia. assert (x = 2 * f * (j * k)) as X by (rewrite J, K; ring).
    assert (x <= 2 * f * q \/ 2 * f * q + 2 * f <= x) as C1.
    { rewrite X. destruct (Z_le_dec (j * k) q); [left; nia | right; assert (q + 1 <= j * k) by lia; nia]. }
    assert (2 * f * q + 2 * f <= x + e \/ x + e <= 2 * f * q) as C2.
    { rewrite X, K. destruct (Z_le_dec (q + 1) (j * k + k)); [left | right; assert (j * k + k <= q) by lia]; nia. }
    clear K X I J. unfold gap. lia.
Qed.
Lemma nearest p a : octant p -> octant a -> level a < level p -> exists o, octant o /\ level o = level p - 1 /\ within o a /\ distance p o = distance p a.
Proof.
  intros P A L. pose proof (edge_pos p P) as EP. pose proof (edge_pos a A) as EA.
  destruct P as (LP & DX & DY & DZ & _). pose proof A as (LA & AX & AY & AZ & IR).
  assert (2 * edge p = cells (level p - 1)) as E by (unfold edge; rewrite (cells_double (level p - 1)) by lia; do 2 f_equal; lia).
  assert (2 * edge p | edge a) as D by (rewrite E; apply cells_divide; lia).
  destruct (axis_nearest _ _ _ _ EP D EA DX AX) as (x & X & X0 & X1 & GX).
  destruct (axis_nearest _ _ _ _ EP D EA DY AY) as (y & Y & Y0 & Y1 & GY).
  destruct (axis_nearest _ _ _ _ EP D EA DZ AZ) as (z & Z' & Z0 & Z1 & GZ).
  exists (Leaf x y z (level p - 1) Outside). set (o := Leaf _ _ _ _ _).
  assert (edge o = 2 * edge p) as EO by (rewrite E; reflexivity).
  assert (within o a) as W.
  { intros u v w (U & V & T). rewrite EO in U, V, T. cbn [cx cy cz o] in U, V, T. unfold holds. clear - U V T X0 X1 Y0 Y1 Z0 Z1.
    set (e := edge a) in *. set (f := edge p) in *. clearbody e f. lia. }
  split; [|split; [reflexivity | split; [exact W|]]].
  - unfold octant. rewrite EO. cbn [cx cy cz level o]. split; [lia|]. do 3 (split; [assumption|]). intros u v w H. apply IR, W, H.
  - unfold distance. rewrite EO. cbn [cx cy cz o]. rewrite GX, GY, GZ. reflexivity.
Qed.

(** Cells near crossing leaves. *)
Theorem least_near_surface c base m d : fine c base -> region c base m d -> least c base m d -> near_surface c m d.
Proof.
  intros F G LE a b A B S LA. pose proof (graded_octant c base m d G a A) as OA. pose proof (graded_octant c base m d G b B) as OB.
  destruct (home c base m d G b B) as (b0 & B0 & N0 & W0 & S0 & L0). pose proof (F b0 B0 ltac:(congruence)) as F0.
  destruct (home c base m d G a A) as (a0 & A0 & NA & WA & _ & _).
  assert (level b = surface c -> distance a b >= (layer_cells c - 1) * cells (surface c)) as FIRST.
  { intros LB. destruct (Z_lt_dec (distance a b) ((layer_cells c - 1) * cells (surface c))) as [DI|]; [exfalso | lia].
    destruct (nearest b a OB OA ltac:(lia)) as (o & O & LO & WO & DO).
    assert (within o a0) as WO' by (intros u v w H; apply WA, WO, H).
    assert (1 <= level b) as L1 by (destruct O; lia). destruct (parent_octant b OB L1) as [OQ WQ].
    assert (split m d o) as (p & P & WP & LP).
    { apply (LE o a0 O A0 NA WO'). right. exists b. split; [|split; [lia | rewrite DO, distance_comm, LB; exact DI]].
      split; [exact B|]. exists (parent_of b). split; [exact OQ|]. split; [reflexivity|]. split; [exact WQ|].
      left. exists b0. split; [exact B0|].
      destruct (parent_home c base m d G b b0 (parent_of b) B B0 W0 OQ eq_refl WQ) as [WB | [_ IN]]; [|exact IN]. exfalso.
      pose proof (within_level _ _ OQ WB). cbn [level parent_of] in *. lia. }
    pose proof (corner_holds p (graded_octant c base m d G p P)) as C.
    rewrite (graded_one c base m d G p a _ _ _ P A C (WO _ _ _ (WP _ _ _ C))) in LP.
    pose proof (within_level o a O WO). lia. }
  split; [exact FIRST|]. intros KC T.
  destruct (Z_lt_dec (layer_cells c) 3) as [N3|N3].
  - apply (not_split c base m d G a A), (LE a a0 OA A0 NA WA). left; right; right. split; [exact KC|]. split; [exact N3|]. split; [exact LA|].
    exists b0. split; [exact B0|]. split; [congruence|]. apply (touch_within b b0 a OB W0). unfold touch in *. rewrite distance_comm. exact T.
  - pose proof (least_balanced c base m d G LE a b A B T). destruct (Z.eq_dec (level b) (surface c)) as [LB|NB]; [|lia].
    specialize (FIRST LB). rewrite T in FIRST. pose proof (cells_pos (surface c)). destruct OB. nia.
Qed.

(** * Definitions that a reader may doubt *)

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

(** Searches among subtrees that are near: what is found is a leaf of the tree at the distance that was asked for. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Check Octants Pairs Unique.
Open Scope Z_scope.

Definition cube (x y z : Z) (h : nat) : leaf := Leaf x y z (19 - Z.of_nat h) Outside.
Lemma cube_edge x y z h : edge (cube x y z h) = E h.
Proof. apply E_cells. Qed.
Lemma off_range b n : 0 <= off b n <= E n.
Proof. pose proof (E_pos n). destruct b; cbn [off]; lia. Qed.
Lemma cube_bounds x y z h : octant (cube x y z h) -> 0 < E h /\ (0 <= x /\ x + E h <= 524288) /\ (0 <= y /\ y + E h <= 524288) /\ (0 <= z /\ z + E h <= 524288).
Proof.
  intros O. split; [apply E_pos|]. pose proof (octant_bounds _ O) as B. rewrite cube_edge in B. exact B.
Qed.
Lemma cube_kid x y z n : octant (cube x y z (S n)) -> forall i j k, octant (cube (x + off i n) (y + off j n) (z + off k n) n) /\
  within (cube (x + off i n) (y + off j n) (z + off k n) n) (cube x y z (S n)).
Proof.
  intros (L & DX & DY & DZ & R) i j k. rewrite cube_edge in DX, DY, DZ. cbn [cube cx cy cz level] in *.
  assert (within (cube (x + off i n) (y + off j n) (z + off k n) n) (cube x y z (S n))) as W.
  { intros u v w. unfold holds. rewrite !cube_edge, E_S. cbn [cube cx cy cz]. pose proof (off_range i n). pose proof (off_range j n).
    pose proof (off_range k n). lia. }
  split; [|exact W]. unfold octant. rewrite cube_edge. cbn [cube cx cy cz level].
  assert (forall q b, (E (S n) | q) -> (E n | q + off b n)) as D.
  { intros q b [m Q]. rewrite E_S in Q. subst q. apply Z.divide_add_r; [exists (m * 2); ring|].
    destruct b; [apply Z.divide_refl | apply Z.divide_0_r]. }
  split; [lia|]. do 3 (split; [apply D; assumption|]). intros u v w H. apply R, W, H.
Qed.

Lemma gap_apart p e q f : 0 <= e -> 0 <= f -> Z.abs (q - p) + e + f <= 2097152 -> gap p e q f = Z.max 0 (apart e f (q - p)).
Proof. intros A B C. destruct (apart_small e f (q - p) A B C) as [-> _]. unfold gap. f_equal. f_equal; lia. Qed.
Lemma max_zero a b c : Z.max 0 (Z.max a (Z.max b c)) = Z.max (Z.max 0 a) (Z.max (Z.max 0 b) (Z.max 0 c)).
Proof. lia. Qed.
Lemma far_distance a b : octant a -> octant b -> far (edge a) (edge b) (cx b - cx a) (cy b - cy a) (cz b - cz a) = distance a b.
Proof.
  intros A B. pose proof (octant_bounds a A) as (AX & AY & AZ). pose proof (octant_bounds b B) as (BX & BY & BZ).
  pose proof (edge_pos a A). pose proof (edge_pos b B). unfold far, distance. rewrite max_zero.
  rewrite !gap_apart by (clear - AX AY AZ BX BY BZ H H0; set (e := edge a) in *; set (f := edge b) in *; clearbody e f; lia). reflexivity.
Qed.

Section Near.
Variable s0 : side.
Variable L : list leaf.

Section Find.
Variable crossing : bool.
Variables lo hi reach : Z.
Hypothesis Hhi : hi <= 524288.
Definition found (a o : leaf) : Prop := (crossing = true -> side_of o = Crossing) /\ lo <= edge o <= hi /\ distance a o < reach.

Lemma find_right a : octant a -> forall h u, sized Cross h u -> forall x y z, octant (cube x y z h) ->
  find crossing lo hi reach (edge a) u (E h) (x - cx a) (y - cy a) (z - cz a) = true -> exists o, In o (flat s0 h x y z u) /\ found a o.
Proof.
  intros A h u S. induction S as [h k | n u T M LE K IH B]; intros x y z O H.
  - cbn [find] in H. destruct (_ || _) eqn:C in H; [discriminate|]. clear H. unfold hopeless in C.
    apply orb_false_iff in C. destruct C as [C C1]. apply orb_false_iff in C. destruct C as [C C4]. apply orb_false_iff in C. destruct C as [C2 C3].
    apply Z.leb_gt in C1. apply Z.ltb_ge in C2, C3.
    assert (exists s, side_in s0 k = Some s) as [s K].
    { destruct k; try (eexists; reflexivity). cbn [least] in C2. unfold none in C2. lia. }
    exists (Leaf x y z (19 - Z.of_nat h) s). split; [apply flat_cube; exists s; auto|]. split.
    { intros W. rewrite W in C4. cbn [has andb] in C4. apply negb_false_iff in C4. destruct k; try discriminate. cbn [side_in] in K. cbn [side_of]. congruence. }
    assert (least (Cube k) (E h) = E h /\ most (Cube k) (E h) = E h) as [L1 L2] by (destruct k; cbn [side_in] in K; try discriminate; split; reflexivity).
    rewrite L1, L2 in *. unfold edge. cbn [level]. rewrite E_cells. split; [lia|].
    change (distance a (Leaf x y z (19 - Z.of_nat h) s)) with (distance a (cube x y z h)). rewrite <- far_distance by assumption.
    rewrite cube_edge. exact C1.
  - assert (exists i j k, find crossing lo hi reach (edge a) (kid i j k u) (E n) (x + off i n - cx a) (y + off j n - cy a) (z + off k n - cz a) = true) as (i & j & k & F).
    { pose proof (cube_bounds x y z (S n) O) as (P & X & Y & Z'). rewrite E_S in P, X, Y, Z'. pose proof (octant_bounds a A) as ([? ?] & [? ?] & [? ?]). pose proof (edge_pos a A).
      destruct u as [| p q r a0 b c d e f g h']; [destruct T|]. cbn [find] in H. destruct (_ || _) eqn:C in H; [discriminate|]. clear C.
      cbv zeta in H. rewrite half in H.
      rewrite !(add_small _ (E n)) in H by (unfold small; lia).
      replace (x - cx a + E n) with (x + E n - cx a) in H by ring. replace (y - cy a + E n) with (y + E n - cy a) in H by ring.
      replace (z - cz a + E n) with (z + E n - cz a) in H by ring.
      repeat (apply orb_prop in H; destruct H as [H|H]);
      [exists false, false, false | exists true, false, false | exists false, true, false | exists true, true, false |
       exists false, false, true | exists true, false, true | exists false, true, true | exists true, true, true];
      cbn [kid off]; rewrite ?Z.add_0_r; exact H. }
    destruct (IH i j k _ _ _ (proj1 (cube_kid x y z n O i j k)) F) as (o & I & Q).
    exists o. split; [apply in_flat; [exact T | exists i, j, k; exact I] | exact Q].
Qed.
End Find.

(** Entries of a list are subtrees of one height where they are said to be, seen from (p, q, r). *)
Inductive sits (p q r : Z) (h : nat) : around -> Prop :=
  | sits_nobody : sits p q r h Nobody
  | sits_also u x y z rest : octant (cube (x + p) (y + q) (z + r) h) -> sized Cross h u ->
      (forall o, In o (flat s0 h (x + p) (y + q) (z + r) u) -> In o L) -> sits p q r h rest -> sits p q r h (Also u x y z rest).

Lemma also_right useful reach p q r n u x y z rest : octant (cube (x + p) (y + q) (z + r) n) -> sized Cross n u ->
  (forall o, In o (flat s0 n (x + p) (y + q) (z + r) u) -> In o L) -> sits p q r n rest -> sits p q r n (also useful (E n) reach u x y z rest).
Proof.
  intros O S I R. unfold also. destruct u; [exact R|]. destruct (useful _ _); [|exact R]. destruct (_ && _); [constructor; assumption | exact R].
Qed.

Definition in_range p := 0 <= p <= 524288.
Lemma closer_right useful reach p q r x y z n : in_range p -> in_range q -> in_range r -> in_range (p + x) -> in_range (q + y) -> in_range (r + z) ->
  forall s, sits p q r (S n) s -> sits (p + x) (q + y) (r + z) n (closer useful (E n) reach s x y z).
Proof.
  unfold in_range. intros P Q R X Y Z' s S. induction S as [| u a b c rest O U I _ IH]; cbn [closer]; [constructor|].
  destruct u as [k | m l hs k0 k1 k2 k3 k4 k5 k6 k7]; [exact IH|]. set (u := Node m l hs k0 k1 k2 k3 k4 k5 k6 k7) in *.
  pose proof (cube_bounds _ _ _ _ O) as (EP & BX & BY & BZ). rewrite E_S in EP, BX, BY, BZ.
  cbv zeta. destruct (useful (E n) u); [|exact IH]. rewrite (sub_small a x), (sub_small b y), (sub_small c z) by (unfold small; lia).
  rewrite !(add_small _ (E n)) by (unfold small; lia). destruct (_ && _); [|exact IH].
  assert (forall i j k rest, sits (p + x) (q + y) (r + z) n rest ->
    sits (p + x) (q + y) (r + z) n (also useful (E n) reach (kid i j k u) (a - x + off i n) (b - y + off j n) (c - z + off k n) rest)) as ST.
  { intros i j k rest' RS. apply also_right; [| | |exact RS];
    replace (a - x + off i n + (p + x)) with (a + p + off i n) by ring; replace (b - y + off j n + (q + y)) with (b + q + off j n) by ring;
    replace (c - z + off k n + (r + z)) with (c + r + off k n) by ring.
    - apply cube_kid. exact O.
    - inversion U as [|? ? ? ? ? K ?]; subst. apply K.
    - intros o F. apply I. apply in_flat; [exact Logic.I | exists i, j, k; exact F]. }
  apply (ST true true true) in IH. apply (ST false true true) in IH. apply (ST true false true) in IH. apply (ST false false true) in IH.
  apply (ST true true false) in IH. apply (ST false true false) in IH. apply (ST true false false) in IH. apply (ST false false false) in IH.
  unfold u in IH. cbn [kid off] in IH. rewrite ?Z.add_0_r in IH. exact IH.
Qed.

(** A list for the cube at (X, Y, W), which is displaced by (x, y, z) from where the list is seen. *)
Definition lists (X Y W : Z) (h : nat) (x y z : Z) (s : around) (m : nat) : Prop :=
  sits (X - x) (Y - y) (W - z) m s /\ in_range (X - x) /\ in_range (Y - y) /\ in_range (W - z) /\
  (m = S h \/ m = h /\ x = 0 /\ y = 0 /\ z = 0).

Lemma find_around_right crossing lo hi reach X Y W h x y z s m : hi <= 524288 -> octant (cube X Y W h) -> lists X Y W h x y z s m ->
  find_around crossing lo hi reach (E h) s (E m) x y z = true -> exists o, In o L /\ found crossing lo hi reach (cube X Y W h) o.
Proof.
  intros HI O (S & RX & RY & RZ & _). pose proof (cube_bounds _ _ _ _ O) as (_ & BX & BY & BZ). unfold in_range in *.
  induction S as [| u a b c rest C U I _ IH]; cbn [find_around]; [discriminate|]. intros H. apply orb_prop in H. destruct H as [H|H]; [|exact (IH H)].
  pose proof (cube_bounds _ _ _ _ C) as (EP & CX & CY & CZ).
  rewrite (sub_small a x), (sub_small b y), (sub_small c z) in H by (unfold small; pose proof (E_pos h); lia).
  replace (a - x) with (a + (X - x) - X) in H by ring. replace (b - y) with (b + (Y - y) - Y) in H by ring. replace (c - z) with (c + (W - z) - W) in H by ring.
  rewrite <- (cube_edge X Y W h) in H.
  destruct (find_right crossing lo hi reach HI (cube X Y W h) O m u U _ _ _ C H) as (o & F & Q). exists o. split; [apply I; exact F | exact Q].
Qed.

Lemma descend_right useful reach X Y W n x y z s m : octant (cube X Y W (S n)) -> lists X Y W (S n) x y z s m -> forall i j k,
  lists (X + off i n) (Y + off j n) (W + off k n) n (off i n) (off j n) (off k n) (descend useful (E (S n)) reach s (E m) x y z) (S n).
Proof.
  intros O (S & RX & RY & RZ & C) i j k. pose proof (cube_bounds _ _ _ _ O) as (EP & BX & BY & BZ).
  unfold lists. replace (X + off i n - off i n) with X by ring. replace (Y + off j n - off j n) with Y by ring.
  replace (W + off k n - off k n) with W by ring.
  split; [|unfold in_range; split; [lia|]; split; [lia|]; split; [lia | left; reflexivity]].
  unfold descend. destruct C as [-> | (-> & -> & -> & ->)].
  - destruct (Z.ltb_spec (E (Datatypes.S n)) (E (Datatypes.S (Datatypes.S n)))) as [_|N]; [|rewrite (E_S (Datatypes.S n)) in N; lia].
    replace X with (X - x + x) at 1 by ring. replace Y with (Y - y + y) at 1 by ring. replace W with (W - z + z) at 1 by ring.
    apply closer_right; trivial; unfold in_range; lia.
  - rewrite Z.ltb_irrefl. rewrite !Z.sub_0_r in S. exact S.
Qed.
Lemma nobody_right X Y W n i j k : octant (cube X Y W (S n)) ->
  lists (X + off i n) (Y + off j n) (W + off k n) n (off i n) (off j n) (off k n) Nobody (S n).
Proof.
  intros O. pose proof (cube_bounds _ _ _ _ O) as (EP & BX & BY & BZ). split; [constructor|].
  unfold in_range. split; [lia|]. split; [lia|]. split; [lia | left; reflexivity].
Qed.
End Near.

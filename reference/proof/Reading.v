(** Reading: a tree has exactly the leaves of the files from which it was made. *)
From Coq Require Import ZArith List Bool Lia Permutation.
Import ListNotations.
From Proof Require Import Statement Checker Octants.
Open Scope Z_scope.

(** * Keys *)

Lemma eight h : 8 ^ Z.of_nat (S h) = 8 * 8 ^ Z.of_nat h.
Proof. rewrite Nat2Z.inj_succ, Z.pow_succ_r; lia. Qed.
Lemma eight_pos h : 0 < 8 ^ Z.of_nat h. Proof. apply Z.pow_pos_nonneg; lia. Qed.

Definition on_axis a := a = 0 \/ a = 1 \/ a = 2.
Lemma coordinate_step b a q c : on_axis a -> 0 <= c < 8 ->
  coordinate (S b) a (8 * q + c) = (c / 2 ^ a) mod 2 + 2 * coordinate b a q.
Proof.
  intros A C. cbn [coordinate].
  replace ((8 * q + c) / 8) with q by (apply Z.div_unique with c; lia).
  f_equal.
  assert (c = 0 \/ c = 1 \/ c = 2 \/ c = 3 \/ c = 4 \/ c = 5 \/ c = 6 \/ c = 7) as D by lia.
  destruct A as [-> | [-> | ->]]; [change (2 ^ 0) with 1 | change (2 ^ 1) with 2 | change (2 ^ 2) with 4];
    Z.to_euclidean_division_equations; lia.
Qed.
Lemma coordinate_eight b a q : on_axis a -> coordinate (S b) a (8 * q) = 2 * coordinate b a q.
Proof. intros A. replace (8 * q) with (8 * q + 0) by lia. rewrite coordinate_step by (trivial; lia).
  destruct A as [-> | [-> | ->]]; reflexivity. Qed.
Lemma coordinate_scale h b a q : on_axis a -> coordinate (h + b) a (8 ^ Z.of_nat h * q) = E h * coordinate b a q.
Proof.
  intros A. induction h as [| h IH].
  - cbn [plus Z.of_nat]. change (8 ^ 0) with 1. replace (E 0) with 1 by reflexivity. rewrite !Z.mul_1_l. reflexivity.
  - rewrite eight, E_S. cbn [plus]. rewrite <- !Z.mul_assoc, coordinate_eight, IH by trivial. reflexivity.
Qed.
(** A child's key adds a bit to each coordinate. *)
Lemma coordinate_child h b a q c : on_axis a -> 0 <= c < 8 ->
  coordinate (h + S b) a (8 ^ Z.of_nat h * (8 * q + c)) =
  coordinate (h + S b) a (8 ^ Z.of_nat h * (8 * q)) + (c / 2 ^ a) mod 2 * E h.
Proof. intros A C. rewrite !coordinate_scale, coordinate_step, coordinate_eight by trivial. ring. Qed.

(** * One file *)

Definition zrange (i j : Z) : list Z := map (fun m => i + Z.of_nat m) (seq 0 (Z.to_nat (j - i))).
Lemma zrange_nil i : zrange i i = [].
Proof. unfold zrange. rewrite Z.sub_diag. reflexivity. Qed.
Lemma zrange_cons i j : i < j -> zrange i j = i :: zrange (i + 1) j.
Proof.
  intros L. unfold zrange. replace (Z.to_nat (j - i)) with (S (Z.to_nat (j - (i + 1)))) by lia.
  cbn [seq map]. f_equal; [lia|]. rewrite <- seq_shift, map_map. apply map_ext. intros. lia.
Qed.
Lemma zrange_one i : zrange i (i + 1) = [i].
Proof. rewrite zrange_cons, zrange_nil by lia. reflexivity. Qed.
Lemma zrange_app i j k : i <= j -> j <= k -> zrange i k = zrange i j ++ zrange j k.
Proof.
  intros A B. replace j with (i + Z.of_nat (Z.to_nat (j - i))) in * by lia.
  generalize dependent (Z.to_nat (j - i)). clear j. intros n A B. clear A. revert i B. induction n as [| n IH]; intros i B.
  - rewrite Z.add_0_r, zrange_nil. reflexivity.
  - rewrite (zrange_cons i k), (zrange_cons i (i + Z.of_nat (S n))) by lia. cbn [app]. f_equal.
    replace (i + Z.of_nat (S n)) with (i + 1 + Z.of_nat n) in * by lia. apply IH. exact B.
Qed.
Lemma leaves_zrange p : leaves_of p = map (leaf_at p) (zrange 0 (count p)).
Proof. unfold leaves_of, zrange. rewrite Z.sub_0_r. f_equal. Qed.

Section Part.
Variable k0 : kind.
Variable s0 : side.
Variable p : part.

Definition word_right c := 0 <= code p c / 4 <= 19 /\ code p c mod 4 <= 2.
Definition run i j lo hi := i <= j /\ (forall c, i <= c < j -> lo <= key p c < hi /\ word_right c) /\
  forall c d, i <= c < d -> d < j -> key p c < key p d.
Lemma run_app i j k lo mid hi : lo <= mid <= hi -> run i j lo mid -> run j k mid hi -> run i k lo hi.
Proof.
  intros M (A & B & C) (A' & B' & C'). split; [lia|]. split.
  - intros c I. destruct (Z_lt_dec c j); [destruct (B c) | destruct (B' c)]; try lia; (split; [lia | assumption]).
  - intros c d I K. destruct (Z_lt_dec d j); [apply C; lia|]. destruct (Z_lt_dec c j); [|apply C'; lia].
    destruct (B c) as [? _]; [lia|]. destruct (B' d) as [? _]; lia.
Qed.

Definition at_key a k := coordinate 19 a k.
Definition good (h : nat) (k : Z) (t : tree) (i j : Z) := j <= count p /\ sized k0 h t /\ run i j k (k + 8 ^ Z.of_nat h) /\
  flat s0 h (at_key 0 k) (at_key 1 k) (at_key 2 k) t = map (leaf_at p) (zrange i j).

Lemma parse_good : 0 <= count p <= 144115188075855872 -> forall h l z v k i t j, Z.of_nat h = 19 - l -> 0 <= l ->
  z = E h -> v = 8 ^ Z.of_nat h -> (v | k) -> 0 <= k -> k + v <= 144115188075855872 -> 0 <= i <= count p ->
  parse k0 p h l z v k i = Good t j -> good h k t i j.
Proof.
  intros Hp.
  assert (forall h k v i t j, 0 <= v -> 0 <= i <= count p -> v = 8 ^ Z.of_nat h -> Good (Cube Empty) i = Good t j -> good h k t i j) as EMPTY.
  { intros h k v i t j V I -> H. injection H as <- <-. split; [lia|]. split; [constructor|]. split.
    - split; [lia|]. split; intros; lia.
    - rewrite zrange_nil. destruct h; reflexivity. }
  induction h as [| h IH]; intros l z v k i t j Hh Hl Hz Hv Hk K0 K1 I H; cbn [parse] in H;
    (assert (0 < v) as V0 by (subst v; apply eight_pos));
    rewrite (add_small k v) in H by (unfold small; lia);
    (destruct (Z.ltb_spec i (count p)) as [Li|_]; [| apply (EMPTY _ _ v); trivial; lia]);
    rewrite (add_small i 1) in H by (unfold small; lia);
    (destruct (k + v <=? key p i); [apply (EMPTY _ _ v); trivial; lia|]);
    (match type of H with (if ?c then _ else _) = _ => destruct c eqn:M end;
     [apply andb_prop in M; destruct M as [M1 M2]; apply Z.eqb_eq in M1; apply Z.eqb_eq in M2;
      rewrite Z.shiftr_div_pow2 in M2 by lia; change (2 ^ 2) with 4 in M2;
      change 3 with (Z.ones 2) in H; rewrite Z.land_ones in H by lia; change (2 ^ 2) with 4 in H; cbv zeta in H;
      assert (exists kd, t = Cube kd /\ j = i + 1 /\ code p i mod 4 <= 2 /\ side_in s0 kd = Some (side_of_code (code p i))) as (kd & -> & -> & S2 & S3)
        by (unfold side_of_code; pose proof (Z.mod_pos_bound (code p i) 4);
            destruct (Z.eqb_spec (code p i mod 4) 0); [injection H as <- <-; exists Outer; repeat split; lia|];
            destruct (Z.eqb_spec (code p i mod 4) 1); [injection H as <- <-; exists Inner; repeat split; lia|];
            destruct (Z.eqb_spec (code p i mod 4) 2); [injection H as <- <-; exists Cross; repeat split; lia | discriminate]);
      split; [lia|]; split; [constructor|]; split;
      [split; [lia|]; split; [|intros; lia]; intros c C; replace c with i by lia; unfold word_right; rewrite M1, M2, <- Hv; lia
      | rewrite zrange_one; cbn [map flat]; unfold leaf_at; rewrite M1, M2; cbn [flat]; rewrite S3; unfold at_key;
        first [replace (19 - Z.of_nat (S h)) with l by lia | replace (19 - Z.of_nat 0) with l by lia]; reflexivity]
     | clear M]).
  - discriminate.
  - clear EMPTY. pose proof (eight_pos h) as P8. rewrite (add_small l 1) in H by (unfold small; lia). set (l' := l + 1) in *.
    assert (Z.shiftr z 1 = E h) as Z1 by (rewrite Hz; apply half).
    rewrite eight in Hv.
    assert (Z.shiftr v 3 = 8 ^ Z.of_nat h) as V1.
    { rewrite Z.shiftr_div_pow2 by lia. change (2 ^ 3) with 8. rewrite Hv. symmetry. apply Z.div_unique with 0; lia. }
    cbv zeta in H. rewrite Z1, V1 in H. set (w := 8 ^ Z.of_nat h) in *.
    assert (Z.of_nat h = 19 - l') as Hh' by lia. assert (0 <= l') as Hl' by lia.
    destruct Hk as [q Hq]. rewrite Hv in Hq.
    assert (forall c, 0 <= c < 8 ->
      (w | k + c * w) /\ forall a, on_axis a -> coordinate 19 a (k + c * w) = coordinate 19 a k + (c / 2 ^ a) mod 2 * E h) as CH.
    { intros c C. split; [exists (8 * q + c); subst k; ring|]. intros a A.
      replace (k + c * w) with (w * (8 * q + c)) by (subst k; ring).
      replace k with (w * (8 * q)) by (subst k; ring).
      replace 19%nat with (h + S (18 - h))%nat by lia. apply coordinate_child; trivial. }
    clearbody l'.
    rewrite (add_small k w), (add_small (k + w) w), (add_small (k + w + w) w), (add_small (k + w + w + w) w),
      (add_small (k + w + w + w + w) w), (add_small (k + w + w + w + w + w) w),
      (add_small (k + w + w + w + w + w + w) w) in H by (unfold small; lia).
    repeat match type of H with
    | match parse _ _ _ _ _ _ ?kk ?ii with _ => _ end = _ =>
      let G := fresh "G" in let t := fresh "t" in let j := fresh "j" in
      destruct (parse k0 p h l' (E h) w kk ii) as [| t j] eqn:G; [discriminate|]
    end.
    rewrite share_right in H.
    injection H as <- <-.
    assert (forall c kk t i j, 0 <= c < 8 -> kk = k + c * w -> 0 <= i <= count p -> parse k0 p h l' (E h) w kk i = Good t j ->
      j <= count p /\ sized k0 h t /\ run i j (k + c * w) (k + (c + 1) * w) /\
      flat s0 h (coordinate 19 0 k + (c / 2 ^ 0) mod 2 * E h) (coordinate 19 1 k + (c / 2 ^ 1) mod 2 * E h)
                (coordinate 19 2 k + (c / 2 ^ 2) mod 2 * E h) t = map (leaf_at p) (zrange i j)) as ST.
    { intros c kk t i' j' C K I' P. destruct (CH c C) as [DV CO]. subst kk.
      assert (0 <= c * w <= 7 * w) by nia. assert (0 <= k + c * w) as KA by lia. assert (k + c * w + w <= 144115188075855872) as KB by lia.
      destruct (IH _ _ _ _ _ _ _ Hh' Hl' eq_refl eq_refl DV KA KB I' P) as (A & B & D & F).
      replace (k + (c + 1) * w) with (k + c * w + w) by ring.
      rewrite <- !CO by (unfold on_axis; lia). split; [exact A | split; [exact B | split; [exact D | exact F]]]. }
    clear IH CH.
    assert (forall i j lo hi, run i j lo hi -> i <= j) as RO by (unfold run; tauto).
    apply (ST 0) in G; [|lia|ring|lia]. destruct G as (N0 & S0 & R0 & F0). pose proof (RO _ _ _ _ R0).
    apply (ST 1) in G0; [|lia|ring|lia]. destruct G0 as (N1 & S1 & R1 & F1). pose proof (RO _ _ _ _ R1).
    apply (ST 2) in G1; [|lia|ring|lia]. destruct G1 as (N2 & S2 & R2 & F2). pose proof (RO _ _ _ _ R2).
    apply (ST 3) in G2; [|lia|ring|lia]. destruct G2 as (N3 & S3 & R3 & F3). pose proof (RO _ _ _ _ R3).
    apply (ST 4) in G3; [|lia|ring|lia]. destruct G3 as (N4 & S4 & R4 & F4). pose proof (RO _ _ _ _ R4).
    apply (ST 5) in G4; [|lia|ring|lia]. destruct G4 as (N5 & S5 & R5 & F5). pose proof (RO _ _ _ _ R5).
    apply (ST 6) in G5; [|lia|ring|lia]. destruct G5 as (N6 & S6 & R6 & F6). pose proof (RO _ _ _ _ R6).
    apply (ST 7) in G6; [|lia|ring|lia]. destruct G6 as (N7 & S7 & R7 & F7). pose proof (RO _ _ _ _ R7).
    clear ST RO.
    change (0 + 1) with 1 in *. change (1 + 1) with 2 in *. change (2 + 1) with 3 in *. change (3 + 1) with 4 in *.
    change (4 + 1) with 5 in *. change (5 + 1) with 6 in *. change (6 + 1) with 7 in *. change (7 + 1) with 8 in *.
    split; [exact N7|]. split; [|split].
    + apply sized_join; [lia|]. intros x y z'. destruct x, y, z'; assumption.
    + rewrite eight. fold w. replace (k + 8 * w) with (k + 8 * w) by lia. replace (k + 0 * w) with k in * by ring.
      apply (run_app i j6 j7 k (k + 7 * w)); [lia| |exact R7].
      apply (run_app i j5 j6 k (k + 6 * w)); [lia| |exact R6].
      apply (run_app i j4 j5 k (k + 5 * w)); [lia| |exact R5].
      apply (run_app i j3 j4 k (k + 4 * w)); [lia| |exact R4].
      apply (run_app i j2 j3 k (k + 3 * w)); [lia| |exact R3].
      apply (run_app i j1 j2 k (k + 2 * w)); [lia| |exact R2].
      apply (run_app i j0 j1 k (k + 1 * w)); [lia|exact R0|exact R1].
    + unfold join, at_key. cbn [flat].
      repeat match goal with F : flat _ _ (_ + (?a / 2 ^ 0) mod 2 * _) _ _ _ = _ |- _ =>
        let r := eval compute in ((a / 2 ^ 0) mod 2) in change ((a / 2 ^ 0) mod 2) with r in F;
        let r := eval compute in ((a / 2 ^ 1) mod 2) in change ((a / 2 ^ 1) mod 2) with r in F;
        let r := eval compute in ((a / 2 ^ 2) mod 2) in change ((a / 2 ^ 2) mod 2) with r in F;
        rewrite ?Z.mul_0_l, ?Z.mul_1_l, ?Z.add_0_r in F
      end.
      rewrite F0, F1, F2, F3, F4, F5, F6, F7.
      rewrite (zrange_app i j0 j7), (zrange_app j0 j1 j7), (zrange_app j1 j2 j7), (zrange_app j2 j3 j7), (zrange_app j3 j4 j7),
        (zrange_app j4 j5 j7), (zrange_app j5 j6 j7) by lia.
      rewrite !map_app. reflexivity.
Qed.

Lemma read_right t : read k0 p = Some t -> words p /\ sized k0 19 t /\ flat s0 19 0 0 0 t = leaves_of p.
Proof.
  unfold read. destruct (andb _ _) eqn:C; [|discriminate]. apply andb_prop in C. rewrite !Z.leb_le in C.
  destruct (parse k0 p 19 0 524288 144115188075855872 0 0) as [| t' i] eqn:P; [discriminate|].
  destruct (Z.eqb_spec i (count p)) as [->|]; [|discriminate]. intros H. injection H as ->.
  apply parse_good in P; try trivial; try lia; [|apply Z.divide_0_r].
  destruct P as (_ & S & (_ & R & O) & F). split; [|split].
  - split.
    + intros c I. destruct (R c I) as [B W]. split; [exact B | exact W].
    + intros c d I K. apply O; assumption.
  - exact S.
  - rewrite leaves_zrange. exact F.
Qed.
End Part.

(** * All files *)

Lemma permutation_flat_map {A B} (f g h : A -> list B) l : (forall a, Permutation (f a) (g a ++ h a)) ->
  Permutation (flat_map f l) (flat_map g l ++ flat_map h l).
Proof.
  intros P. induction l as [| a l IH]; [constructor|]. simpl. rewrite (P a), IH. rewrite <- !app_assoc.
  apply Permutation_app_head. rewrite !app_assoc. apply Permutation_app_tail. apply Permutation_app_comm.
Qed.

Section Merge.
Variable k0 : kind.
Variable s0 : side.

Lemma merge_kids t u z m : inner t -> inner u -> merge k0 t u z = Some m -> inner m /\
  (forall i j k, merge k0 (kid i j k t) (kid i j k u) (Z.shiftr z 1) = Some (kid i j k m)) /\
  exists a b c d e f g h, m = join k0 (Z.shiftr z 1) a b c d e f g h.
Proof.
  destruct t as [| p q r a b c d e f g h]; [contradiction|]. destruct u as [| p' q' r' a' b' c' d' e' f' g' h']; [contradiction|].
  intros _ _ H. cbn [merge] in H. cbv zeta in H.
  repeat match type of H with
  | match merge ?k ?x ?y ?w with _ => _ end = _ => let M := fresh "M" in destruct (merge k x y w) eqn:M; [|discriminate]
  end.
  injection H as <-. split; [exact I|]. split; [|repeat eexists].
  intros i j k. destruct i, j, k; assumption.
Qed.

Lemma merge_right : forall h t, deep h t -> forall u m, (h <= 19)%nat -> sized k0 h t -> sized k0 h u -> merge k0 t u (E h) = Some m ->
  sized k0 h m /\ forall x y z, Permutation (flat s0 h x y z m) (flat s0 h x y z t ++ flat s0 h x y z u).
Proof.
  by_tree.
  - intros h k u m L ST SU H. destruct k.
    + assert (u = m) as <- by (destruct u as [[]|]; injection H; trivial). split; [exact SU|]. intros. destruct h; reflexivity.
    + destruct u as [[]|]; try discriminate. injection H as <-. split; [exact ST|]. intros. destruct h; rewrite app_nil_r; reflexivity.
    + destruct u as [[]|]; try discriminate. injection H as <-. split; [exact ST|]. intros. destruct h; rewrite app_nil_r; reflexivity.
    + destruct u as [[]|]; try discriminate. injection H as <-. split; [exact ST|]. intros. destruct h; rewrite app_nil_r; reflexivity.
    + destruct u as [[]|]; try discriminate. injection H as <-. split; [exact ST|]. intros. destruct h; rewrite app_nil_r; reflexivity.
  - intros n t T _ IH u m L ST SU H. destruct u as [k | p q r a b c d e f g h].
    + assert (k = Empty /\ t = m) as [-> <-].
      { destruct t; [destruct T|]. destruct k; try discriminate. injection H. auto. }
      split; [exact ST|]. intros. cbn [flat side_in]. rewrite app_nil_r. reflexivity.
    + set (u := Node p q r a b c d e f g h) in *. assert (inner u) as U by exact I. clearbody u.
      apply merge_kids in H; [|exact T|exact U]. rewrite half in H. destruct H as (M & K & J).
      assert (forall i j k, sized k0 n (kid i j k m) /\ forall x y z, Permutation (flat s0 n x y z (kid i j k m))
        (flat s0 n x y z (kid i j k t) ++ flat s0 n x y z (kid i j k u))) as KS.
      { intros i j k. apply IH; [lia | | | apply K]; [inversion ST | inversion SU]; subst; trivial; try contradiction; auto. }
      split.
      * destruct J as (? & ? & ? & ? & ? & ? & ? & ? & ->). apply sized_join; [lia|]. intros. apply KS.
      * intros x y z. rewrite !flat_kids by assumption. apply permutation_flat_map. intros [[i j] k]. apply KS.
Qed.

Lemma build_right parts t : build k0 parts = Some t ->
  Forall words parts /\ sized k0 19 t /\ Permutation (flat s0 19 0 0 0 t) (leaves parts).
Proof.
  revert t. induction parts as [| p rest IH]; intros t H; cbn [build] in H.
  - injection H as <-. split; [constructor|]. split; [constructor | constructor].
  - destruct (read k0 p) as [a|] eqn:A; [|discriminate]. destruct (build k0 rest) as [b|] eqn:B; [|discriminate].
    apply (read_right k0 s0) in A. destruct A as (W & S & F). destruct (IH b eq_refl) as (W' & S' & F').
    rewrite <- E_root in H. apply merge_right in H; [|apply (sized_deep k0); exact S | lia | exact S | exact S'].
    destruct H as [SM P]. split; [constructor; assumption|]. split; [exact SM|].
    rewrite (P 0 0 0), F, F'. reflexivity.
Qed.
End Merge.

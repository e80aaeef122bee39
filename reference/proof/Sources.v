(** What is marked as a source is one, what is not has siblings that are none, and what is served is in a layer; and the walks that
    decide this. *)
From Coq Require Import ZArith List Bool Lia.
Import ListNotations.
From Proof Require Import Statement Checker Check Octants Pairs Flood Base Unique Near.
Open Scope Z_scope.

(** * Sources *)

Definition same_cube (a b : leaf) : Prop := cx a = cx b /\ cy a = cy b /\ cz a = cz b /\ level a = level b.
Definition child_of (o q : leaf) : Prop := octant q /\ level q = level o - 1 /\ within o q.
Lemma parent_inner t : parent t = true <-> inner t.
Proof. destruct t; cbn; split; trivial; [discriminate | contradiction]. Qed.
Lemma cube_child h X Y W k : parent (Cube k) = false -> forall o, In o (flat Outside h X Y W (Cube k)) -> same_cube o (cube X Y W h) /\ k <> Empty.
Proof. intros _ o O. apply flat_cube in O. destruct O as (s & K & ->). split; [repeat split|]. intros ->. discriminate. Qed.
Lemma same_cube_child X Y W n i j k o : octant (cube X Y W (S n)) -> same_cube o (cube (X + off i n) (Y + off j n) (W + off k n) n) ->
  child_of o (cube X Y W (S n)).
Proof.
  intros O (A & B & C & D). split; [exact O|]. rewrite D. cbn [cube level]. split; [lia|].
  intros u v w H. apply (proj2 (cube_kid X Y W n O i j k)). unfold holds, edge in *. rewrite <- A, <- B, <- C, <- D. exact H.
Qed.

Section Mark.
Variable c : inputs.
Variables base mesh dropped : list leaf.
Let graded := mesh ++ dropped.
Variable s : Z.
Variable extra : bool.
Hypothesis Hs : 0 <= surface c <= 19 /\ s = cells (surface c).
Hypothesis He : extra = true -> keep_crossing c = false /\ layer_cells c < 3.
Hypothesis home : forall o, In o graded -> exists b, In b base /\ within o b /\ side_of o = side_of b.
Hypothesis graded_octants : forall o, In o graded -> octant o.
Variable s1 : side.
Variable fate : kind -> kind.
Hypothesis fate_empty : fate Empty = Empty.
Local Notation early q := (split_early c base mesh dropped q).

Lemma coarser_level a b : octant a -> octant b -> 4 * edge a <= edge b -> level b + 2 <= level a.
Proof.
  intros OA OB H. pose proof (edge_pos a OA). destruct OA as [LA _], OB as [LB _]. unfold edge in *.
  destruct (Z_le_dec (level b + 2) (level a)) as [|N]; [assumption|]. exfalso.
  destruct (Z.eq_dec (level b) 19) as [E'|E'].
  - rewrite E' in H. change (cells 19) with 1 in H. lia.
  - pose proof (cells_antitone (level a) (level b + 1) ltac:(lia)). rewrite (cells_double (level b)) in H by lia. lia.
Qed.

Lemma touched_right X Y W n x y z near m : octant (cube X Y W (S n)) -> lists Outside graded X Y W (S n) x y z near m ->
  touched s extra (E (S n)) (E m) x y z near = true -> early (cube X Y W (S n)).
Proof.
  intros O LI H. unfold touched in H. apply orb_prop in H.
  pose proof (cube_bounds _ _ _ _ O) as (_ & [BX BX'] & _).
  destruct H as [H|H].
  - assert (Z.shiftr (E (S n)) 2 = E (S n) / 4) as Q by (rewrite Z.shiftr_div_pow2 by lia; reflexivity). rewrite Q in H.
    assert (E (S n) / 4 <= E (S n)) by (apply Z.div_le_upper_bound; pose proof (E_pos (S n)); lia).
    destruct (find_around_right Outside graded false 1 (E (S n) / 4) 1 X Y W (S n) x y z near m ltac:(lia) O LI H) as (o & I & _ & B & D).
    right; left. exists o. split; [exact I|]. pose proof (distance_nonneg (cube X Y W (S n)) o). split.
    + apply Z.le_ge, coarser_level; [apply graded_octants; exact I | exact O|]. rewrite cube_edge.
      pose proof (Z.mul_div_le (E (S n)) 4). lia.
    + unfold touch. rewrite distance_comm. lia.
  - apply andb_prop in H. destruct H as [H F]. apply andb_prop in H. destruct H as [X1 X2]. apply Z.ltb_lt in X2.
    destruct (find_around_right Outside graded true 1 524288 1 X Y W (S n) x y z near m ltac:(lia) O LI F) as (o & I & HC & B & D).
    destruct (He X1) as [K1 K2]. right; right. split; [exact K1|]. split; [exact K2|]. pose proof (distance_nonneg (cube X Y W (S n)) o). split.
    + cbn [level cube]. destruct Hs as [S1 S2]. destruct (Z_lt_dec (19 - Z.of_nat (S n)) (surface c)) as [|N]; [assumption|]. exfalso.
      pose proof (cells_antitone (surface c) (19 - Z.of_nat (S n)) ltac:(lia)). rewrite E_cells in *. lia.
    + destruct (home o I) as (b & Hb & Wb & Sb). exists b. split; [exact Hb|]. split.
      * rewrite <- Sb. exact (HC eq_refl).
      * apply (touch_within o b); [apply graded_octants; exact I | exact Wb|]. unfold touch. rewrite distance_comm. lia.
Qed.

Definition deeper (u : tree) : bool := parent (kid false false false u) || parent (kid true false false u) || parent (kid false true false u) ||
  parent (kid true true false u) || parent (kid false false true u) || parent (kid true false true u) || parent (kid false true true u) || parent (kid true true true u).
Lemma deeper_kid u : deeper u = true -> exists i j k, inner (kid i j k u).
Proof.
  unfold deeper. intros H. repeat (apply orb_prop in H; destruct H as [H|H]); apply parent_inner in H; eauto.
Qed.
Lemma not_deeper u : deeper u = false -> forall i j k, exists q, kid i j k u = Cube q.
Proof.
  intros H i j k. destruct (kid i j k u) as [q|] eqn:K; [exists q; reflexivity|]. exfalso.
  assert (deeper u = true) as T; [|congruence]. unfold deeper. destruct i, j, k; rewrite K; cbn [parent]; rewrite ?orb_true_r; reflexivity.
Qed.

Lemma mark_cube k t p q x y z near e : mark_sources s extra t (Cube k) p q x y z near e =
  match k with Empty => Cube Empty | _ => if e then Cube Cross else Cube Outer end.
Proof. destruct k; reflexivity. Qed.
Lemma mark_node n t u q x y z near e : inner u -> let e' := parent t || deeper u || touched s extra (E (S n)) q x y z near in
  let near' := if deeper u then descend (may_touch extra) (E (S n)) 1 near q x y z else Nobody in
  let v := mark_sources s extra t u (E (S n)) q x y z near e in inner v /\
  (forall i j k, kid i j k v = mark_sources s extra (kid i j k t) (kid i j k u) (E n) (E (S n)) (off i n) (off j n) (off k n) near' e') /\
  exists k0 k1 k2 k3 k4 k5 k6 k7, v = join Cross (E n) k0 k1 k2 k3 k4 k5 k6 k7.
Proof.
  intros U e' near' v. destruct u as [|m l hs k0 k1 k2 k3 k4 k5 k6 k7]; [destruct U|].
  subst v e' near'. cbn [mark_sources]. rewrite half. cbv zeta.
  set (u := Node m l hs k0 k1 k2 k3 k4 k5 k6 k7) in *.
  change (parent k0 || parent k1 || parent k2 || parent k3 || parent k4 || parent k5 || parent k6 || parent k7) with (deeper u).
  destruct (deeper u) eqn:DP.
  - split; [exact I|]. split; [|repeat eexists]. intros i j k. destruct i, j, k; reflexivity.
  - set (e' := parent t || false || touched s extra (E (S n)) q x y z near).
    match goal with |- context [if ?f then twig ?w _ ?k else ?j] => replace (if f then twig w e' k else j) with j end.
    + split; [exact I|]. split; [|repeat eexists]. intros i j k. destruct (not_deeper u DP i j k) as [r R].
      rewrite R, mark_cube. destruct i, j, k; cbn [u kid] in R |- *; rewrite R; destruct r; reflexivity.
    + destruct (_ && _) eqn:F; [|reflexivity]. rewrite twig_right. split_and.
      assert (forall i j k, full (kid i j k u) = true -> mark_leaf (kid i j k u) e' = Cube (if e' then Cross else Outer)) as M.
      { intros i j k FK. destruct (not_deeper u DP i j k) as [r R]. rewrite R in *. destruct r, e'; try discriminate; reflexivity. }
      pose proof (M false false false) as M0. pose proof (M true false false) as M1. pose proof (M false true false) as M2. pose proof (M true true false) as M3.
      pose proof (M false false true) as M4. pose proof (M true false true) as M5. pose proof (M false true true) as M6. pose proof (M true true true) as M7.
      cbn [u kid] in *. rewrite M0, M1, M2, M3, M4, M5, M6, M7 by assumption. rewrite join_twig by (destruct e'; discriminate). destruct e'; reflexivity.
Qed.

Lemma some_leaf k : k <> Empty -> forall h u X Y W, deep h u -> filled k u = true -> exists o, In o (flat Outside h X Y W u).
Proof.
  intros NE h u X Y W D F. pose proof (E_pos h).
  assert (exists sd, side_in Outside k = Some sd) as [sd K] by (destruct k; [congruence|eexists; reflexivity..]).
  destruct (look_flat Outside h u D X Y W X Y W sd) as (o & O & _); try lia; [|exists o; exact O].
  rewrite (filled_look k h u D F). exact K.
Qed.
Lemma filled_kids k u : inner u -> filled k u = true -> forall i j l, filled k (kid i j l u) = true.
Proof. destruct u; [contradiction|]. intros _ H i j l. cbn [filled] in H. split_and. destruct i, j, l; assumption. Qed.

(** A parent that is split early. *)
Lemma early_right X Y W n t u x y z near m i j k q : octant (cube X Y W (S n)) -> deep (S n) t -> deep (S n) u -> inner u -> overlay fate t u = true ->
  lists Outside graded X Y W (S n) x y z near m ->
  (forall o, In o (flat Outside (S n) X Y W u) -> In o graded) -> (inner t -> forall b, In b (flat s1 (S n) X Y W t) -> In b base) ->
  kid i j k u = Cube q -> q <> Empty -> parent t || deeper u || touched s extra (E (S n)) (E m) x y z near = true -> early (cube X Y W (S n)).
Proof.
  intros O Dt Du U OV LI IU IT K NE H. apply orb_prop in H. destruct H as [H|H]; [|exact (touched_right _ _ _ _ _ _ _ _ _ O LI H)].
  destruct t as [k0|] eqn:T.
  - cbn [parent orb] in H. cbn [overlay] in OV.
    pose proof (filled_kids _ _ U OV i j k) as F. rewrite K in F. cbn [filled] in F. apply same_eq in F.
    apply deeper_kid in H. destruct H as (i' & j' & k' & V).
    pose proof (filled_kids _ _ U OV i' j' k') as F'. pose proof (deep_Kid n u i' j' k' Du) as Dv.
    set (v := kid i' j' k' u) in *.
    destruct n as [| n']; [destruct (deep_O v V Dv)|].
    destruct (some_leaf (fate k0) ltac:(congruence) n' (kid false false false v) (X + off i' (S n') + off false n') (Y + off j' (S n') + off false n') (W + off k' (S n') + off false n') (deep_Kid n' v false false false Dv) (filled_kids _ _ V F' false false false)) as (o & P).
    assert (In o (flat Outside (S n') (X + off i' (S n')) (Y + off j' (S n')) (W + off k' (S n')) v)) as P'
      by (apply in_flat; [exact V | exists false, false, false; exact P]).
    assert (In o (flat Outside (S (S n')) X Y W u)) as P'' by (apply in_flat; [exact U | exists i', j', k'; exact P']).
    right; left. exists o. split; [apply IU; exact P''|].
    apply flat_inside in P; [|apply deep_Kid; exact Dv]. split; [cbn [level cube]; lia|].
    apply flat_inside in P''; [|exact Du]. apply (common_touch o (cube X Y W (S (S n'))) (cx o) (cy o) (cz o)).
    + unfold holds. lia.
    + unfold holds. rewrite cube_edge. cbn [cx cy cz cube]. lia.
  - rewrite <- T in *. assert (inner t) as TI by (rewrite T; exact I). clear H.
    pose proof (overlay_kids fate t u TI OV) as [_ OK]. specialize (OK i j k). rewrite K in OK.
    destruct (kid i j k t) as [k2|] eqn:KT; cbn [overlay] in OK; [|destruct q; congruence].
    cbn [filled] in OK. apply same_eq in OK.
    assert (exists sd, side_in s1 k2 = Some sd) as [sd KD] by (destruct k2; try (eexists; reflexivity); congruence).
    left. exists (Leaf (X + off i n) (Y + off j n) (W + off k n) (19 - Z.of_nat n) sd). split.
    + apply (IT TI). apply in_flat; [exact TI|]. exists i, j, k. rewrite KT. apply flat_cube. exists sd. auto.
    + split; [|cbn [level cube]; lia]. intros a b d Hh. apply (proj2 (cube_kid X Y W n O i j k)). exact Hh.
Qed.

Definition quiet (V : list leaf) (o : leaf) : Prop := exists X Y W n, child_of o (cube X Y W (S n)) /\
  (forall i j k, In (cube (X + off i n) (Y + off j n) (W + off k n) n) V) /\ forall b, In b base -> ~ inside b (cube X Y W (S n)).
Definition marked_right (V : list leaf) (o : leaf) : Prop :=
  (side_of o = Crossing -> exists q, child_of o q /\ early q) /\ (side_of o = Outside -> quiet V o) /\ side_of o <> Inside.

Lemma mark_right : forall h u, deep h u -> sized Cross h u -> forall t X Y W x y z near m e, octant (cube X Y W h) -> deep h t -> overlay fate t u = true ->
  lists Outside graded X Y W h x y z near m -> (forall o, In o (flat Outside h X Y W u) -> In o graded) ->
  (inner t -> forall b, In b (flat s1 h X Y W t) -> In b base) -> (forall b, In b base -> inside b (cube X Y W h) -> inner t /\ In b (flat s1 h X Y W t)) ->
  let v := mark_sources s extra t u (E h) (E m) x y z near e in
  sized Cross h v /\
  (forall o, In o (flat Outside h X Y W u) -> exists o', In o' (flat Outside h X Y W v) /\ same_cube o o') /\
  (forall o', In o' (flat Outside h X Y W v) -> exists o, In o (flat Outside h X Y W u) /\ same_cube o o') /\
  (parent u = true -> forall o', In o' (flat Outside h X Y W v) -> marked_right (flat Outside h X Y W v) o').
Proof.
  by_tree.
  - intros h k S t X Y W x y z near m e O Dt OV LI IU IT IB v. subst v. rewrite mark_cube.
    assert (forall k, exists k', (match k with Empty => Cube Empty | _ => if e then Cube Cross else Cube Outer end) = Cube k' /\
      ((exists sd, side_in Outside k = Some sd) <-> (exists sd, side_in Outside k' = Some sd))) as MK.
    { intros []; [exists Empty | destruct e; [exists Cross | exists Outer] ..]; (split; [reflexivity|]); split; intros [? ?]; try discriminate; eexists; reflexivity. }
    destruct (MK k) as (k' & -> & KK). clear MK. split; [constructor|]. split; [|split; [|discriminate]].
    + intros o Q. apply flat_cube in Q. destruct Q as (sd & Q & ->). destruct (proj1 KK (ex_intro _ sd Q)) as [sd' Q'].
      exists (Leaf X Y W (19 - Z.of_nat h) sd'). split; [apply flat_cube; exists sd'; auto | repeat split].
    + intros o Q. apply flat_cube in Q. destruct Q as (sd & Q & ->). destruct (proj2 KK (ex_intro _ sd Q)) as [sd' Q'].
      exists (Leaf X Y W (19 - Z.of_nat h) sd'). split; [apply flat_cube; exists sd'; auto | repeat split].
  - intros n u U Du IH S t X Y W x y z near m e O Dt OV LI IU IT IB v.
    destruct (mark_node n t u (E m) x y z near e U) as (V & KV & k0 & k1 & k2 & k3 & k4 & k5 & k6 & k7 & J). fold v in V, KV, J.
    set (e' := parent t || deeper u || touched s extra (E (Datatypes.S n)) (E m) x y z near) in *.
    set (near' := if deeper u then descend (may_touch extra) (E (Datatypes.S n)) 1 near (E m) x y z else Nobody) in *.
    assert (n <= 18)%nat as N18 by (destruct O as [L _]; cbn [level cube] in L; lia).
    assert (forall i j k, overlay fate (kid i j k t) (kid i j k u) = true) as OVK.
    { intros i j k. destruct t as [k9|] eqn:T.
      - cbn [kid overlay]. cbn [overlay] in OV. replace (overlay fate (Cube k9) (kid i j k u)) with (filled (fate k9) (kid i j k u)) by reflexivity.
        apply filled_kids; assumption.
      - rewrite <- T in *. apply overlay_kids; [rewrite T; exact I | exact OV]. }
    assert (forall i j k, let X' := X + off i n in let Y' := Y + off j n in let W' := W + off k n in
      (sized Cross n (kid i j k v) /\
      (forall o, In o (flat Outside n X' Y' W' (kid i j k u)) -> exists o', In o' (flat Outside n X' Y' W' (kid i j k v)) /\ same_cube o o') /\
      (forall o', In o' (flat Outside n X' Y' W' (kid i j k v)) -> exists o, In o (flat Outside n X' Y' W' (kid i j k u)) /\ same_cube o o') /\
      (parent (kid i j k u) = true -> forall o', In o' (flat Outside n X' Y' W' (kid i j k v)) -> marked_right (flat Outside n X' Y' W' (kid i j k v)) o'))) as KIDS.
    { intros i j k X' Y' W'. rewrite KV. apply IH.
      - inversion S as [|? ? ? ? ? K ?]; subst; [destruct U|]. apply K.
      - apply (cube_kid X Y W n O i j k).
      - apply deep_Kid. exact Dt.
      - apply OVK.
      - subst near'. destruct (deeper u); [apply descend_right; assumption | apply nobody_right; exact O].
      - intros o Q. apply IU. apply in_flat; [exact U | exists i, j, k; exact Q].
      - intros TI b Q. assert (inner t) as TT by (destruct t; [exact TI | exact I]). apply (IT TT). apply in_flat; [exact TT | exists i, j, k; exact Q].
      - intros b B IN. pose proof (cube_kid X Y W n O i j k) as [OK WK].
        assert (inside b (cube X Y W (Datatypes.S n))) as IN' by (destruct IN as [WI LI']; split; [intros p q r Q; apply WK, WI, Q | cbn [level cube] in *; lia]).
        destruct (IB b B IN') as [TI Q]. apply in_flat in Q; [|exact TI]. destruct Q as (i' & j' & k' & Q).
        pose proof (flat_inside s1 n _ (deep_Kid n t i' j' k' Dt) _ _ _ _ Q) as (BX & BY & BZ & EP & _).
        destruct IN as [WI LV]. assert (holds b (cx b) (cy b) (cz b)) as H by (unfold holds; lia). apply WI in H.
        unfold holds in H. rewrite cube_edge in H. cbn [cx cy cz cube] in H. unfold off in *. pose proof (E_pos n).
        assert (i' = i) as -> by (clear - H BX EP H0; destruct i, i'; trivial; lia). assert (j' = j) as -> by (clear - H BY EP H0; destruct j, j'; trivial; lia).
        assert (k' = k) as -> by (clear - H BZ EP H0; destruct k, k'; trivial; lia).
        split; [|exact Q]. destruct (kid i j k t) as [k9|]; [|exact I]. exfalso. apply flat_cube in Q. destruct Q as (sd & _ & ->).
        cbn [level cube] in LV. lia. }
    clearbody v.
    split; [rewrite J; apply sized_join; [exact N18|]; intros i j k; rewrite <- J; apply KIDS|].
    split; [|split].
    + intros o Q. apply in_flat in Q; [|exact U]. destruct Q as (i & j & k & Q). destruct (KIDS i j k) as (_ & A & _ & _).
      destruct (A o Q) as (o' & Q' & SC). exists o'. split; [|exact SC]. apply in_flat; [exact V | exists i, j, k; exact Q'].
    + intros o Q. apply in_flat in Q; [|exact V]. destruct Q as (i & j & k & Q). destruct (KIDS i j k) as (_ & _ & A & _).
      destruct (A o Q) as (o' & Q' & SC). exists o'. split; [|exact SC]. apply in_flat; [exact U | exists i, j, k; exact Q'].
    + intros _ o Q. apply in_flat in Q; [|exact V]. destruct Q as (i & j & k & Q).
      destruct (kid i j k u) as [q|] eqn:KU.
      * rewrite KV, KU, mark_cube in Q.
        assert (q <> Empty) as NE by (intros ->; apply flat_cube in Q; destruct Q as (? & ? & _); discriminate).
        destruct e' eqn:EE.
        -- assert (In o (flat Outside n (X + off i n) (Y + off j n) (W + off k n) (Cube Cross))) as Q' by (destruct q; [congruence | exact Q ..]).
           apply flat_cube in Q'. destruct Q' as (sd & SD & ->). injection SD as <-. split; [|split; discriminate]. intros _.
           exists (cube X Y W (Datatypes.S n)). split; [apply (same_cube_child X Y W n i j k); [exact O | repeat split]|].
           exact (early_right X Y W n t u x y z near m i j k q O Dt Du U OV LI IU IT KU NE EE).
        -- assert (In o (flat Outside n (X + off i n) (Y + off j n) (W + off k n) (Cube Outer))) as Q' by (destruct q; [congruence | exact Q ..]).
           apply flat_cube in Q'. destruct Q' as (sd & SD & ->). injection SD as <-. split; [discriminate|]. split; [|discriminate]. intros _.
           exists X, Y, W, n. split; [apply (same_cube_child X Y W n i j k); [exact O | repeat split]|].
           apply orb_false_iff in EE. destruct EE as [EE _]. apply orb_false_iff in EE. destruct EE as [ET ED].
           split.
           ++ destruct t as [k9|]; [|discriminate]. cbn [overlay] in OV.
              assert (forall i j k p, kid i j k u = Cube p -> fate k9 = p) as FK.
              { intros i' j' k' p P. pose proof (filled_kids _ _ U OV i' j' k') as F. rewrite P in F. apply same_eq in F. congruence. }
              intros i' j' k'. apply in_flat; [exact V|]. exists i', j', k'. rewrite KV.
              destruct (not_deeper u ED i' j' k') as [p P]. rewrite P, mark_cube.
              assert (p = q) as -> by (rewrite <- (FK i' j' k' p P); apply (FK i j k q KU)).
              destruct q; [congruence | apply flat_cube; exists Outside; split; reflexivity ..].
           ++ intros b B IN. destruct (IB b B IN) as [TI _]. apply parent_inner in TI. congruence.
      * destruct (KIDS i j k) as (_ & _ & _ & A). rewrite KU in A. specialize (A eq_refl o Q). destruct A as (A1 & A2 & A3).
        split; [exact A1|]. split; [|exact A3]. intros SO. destruct (A2 SO) as (X' & Y' & W' & n' & CH & KK & NB).
        exists X', Y', W', n'. split; [exact CH|]. split; [|exact NB].
        intros i' j' k'. apply in_flat; [exact V|]. exists i, j, k. apply KK.
Qed.
End Mark.

(** * The walks that decide leastness: [served], and the rules for pairs of marked leaves *)

Lemma same_edge a b : octant a -> octant b -> edge a = edge b -> level a = level b.
Proof.
  intros [LA _] [LB _] H. unfold edge in H. destruct (Z.lt_trichotomy (level a) (level b)) as [L|[L|L]]; [exfalso | exact L | exfalso].
  - pose proof (cells_less (level a) (level b) L). pose proof (cells_pos (level b)). lia.
  - pose proof (cells_less (level b) (level a) L). pose proof (cells_pos (level a)). lia.
Qed.

Lemma sources_only_right h t : sources_only t = true -> forall x y z a, In a (flat Outside h x y z t) -> side_of a = Crossing.
Proof.
  intros H x y z a A. destruct t as [[]|m l hs k0 k1 k2 k3 k4 k5 k6 k7]; try discriminate.
  - apply flat_cube in A. destruct A as (sd & SD & ->). cbn [side_in side_of] in *. congruence.
  - destruct h as [|h]; [destruct A|]. apply in_flat in A; [|exact I]. destruct A as (i & j & k & A).
    destruct k0 as [[]|]; try discriminate; destruct k1 as [[]|]; try discriminate; destruct k2 as [[]|]; try discriminate; destruct k3 as [[]|]; try discriminate;
    destruct k4 as [[]|]; try discriminate; destruct k5 as [[]|]; try discriminate; destruct k6 as [[]|]; try discriminate; destruct k7 as [[]|]; try discriminate.
    assert (exists x y z, In a (flat Outside h x y z (Cube Cross))) as (x' & y' & z' & B) by (destruct i, j, k; cbn [kid] in A; eauto).
    apply flat_cube in B. destruct B as (sd & SD & ->). cbn [side_in side_of] in *. congruence.
Qed.

Section Served.
Variable n : Z.
Hypothesis Hn : 1 <= n <= 4096.
Variable V : list leaf.
Hypothesis octants : forall o, In o V -> octant o.

Definition served_right (o : leaf) : Prop := exists q p, child_of o q /\ In p V /\ side_of p = Crossing /\ level p = level o /\
  distance p q < (n - 1) * cells (level p).

Lemma all_served : forall h v, deep h v -> sized Cross h v -> forall X Y W x y z near m, octant (cube X Y W h) -> lists Outside V X Y W h x y z near m ->
  served n v (E h) (E m) x y z near = true -> parent v = true -> forall o, In o (flat Outside h X Y W v) -> side_of o = Outside -> served_right o.
Proof.
  by_tree; [discriminate|].
  intros h v VI D IH S X Y W x y z near m O LI H _ o Q SO.
  pose proof (cube_bounds _ _ _ _ O) as (EP & BX & BY & BZ). rewrite E_S in EP, BX, BY, BZ.
  assert (sub n 1 = n - 1) as N1 by (apply sub_small; unfold small; lia).
  assert (mul (sub n 1) (E h) = (n - 1) * E h) as N2 by (rewrite N1; apply mul_small; unfold small; nia).
  assert ((exists i j k, late (kid i j k v) = true) -> find_around true (E h) (E h) ((n - 1) * E h) (E (Datatypes.S h)) near (E m) x y z = true) as LATE.
  { intros (i & j & k & LT). destruct v as [|a b k0 k1 k2 k3 k4 k5 k6 k7]; [destruct VI|]. cbn [served] in H. rewrite half in H. cbv zeta in H.
    apply andb_prop in H. destruct H as [H _]. rewrite N2 in H.
    match type of H with (if ?b then _ else _) = _ => replace b with true in H; [exact H|] end.
    symmetry. destruct i, j, k; cbn [kid] in LT; rewrite LT, ?orb_true_r; reflexivity. }
  assert (forall i j k, parent (kid i j k v) = true -> sources_only (kid i j k v) = true \/ served n (kid i j k v) (E h) (E (Datatypes.S h)) (off i h) (off j h) (off k h)
    (descend may_serve (E (Datatypes.S h)) (Z.shiftr (add (mul (sub n 1) (E (Datatypes.S h))) 3) 2) near (E m) x y z) = true) as KIDS.
  { intros i j k PK. destruct v as [|a b k0 k1 k2 k3 k4 k5 k6 k7]; [destruct VI|]. cbn [served] in H. rewrite half in H. cbv zeta in H.
    apply andb_prop in H. destruct H as [_ H].
    match type of H with (if ?b then _ else _) = _ => destruct b eqn:SO' end.
    { left. split_and. destruct i, j, k; assumption. }
    right. match type of H with (if ?b then _ else _) = _ => replace b with true in H end.
    - split_and. destruct i, j, k; assumption.
    - symmetry. destruct i, j, k; cbn [kid] in PK; rewrite PK, ?orb_true_r; reflexivity. }
  clear H. apply in_flat in Q; [|exact VI]. destruct Q as (i & j & k & Q).
  destruct (parent (kid i j k v)) eqn:PK.
  - destruct (KIDS i j k PK) as [ON|KS]; [pose proof (sources_only_right h _ ON _ _ _ o Q); congruence|].
    refine (IH i j k _ _ _ _ _ _ _ _ _ _ _ KS PK o Q SO).
    + inversion S as [|? ? ? ? ? K ?]; subst; [destruct VI|]. apply K.
    + apply (cube_kid X Y W h O i j k).
    + apply descend_right; assumption.
  - destruct (kid i j k v) as [q|] eqn:KV; [|discriminate]. apply flat_cube in Q. destruct Q as (sd & SD & ->). cbn [side_of] in SO. subst sd.
    assert (late (Cube q) = true) as LT by (destruct q; cbn [side_in] in SD; (discriminate || reflexivity)).
    assert (E h <= 524288) as HI by lia.
    destruct (find_around_right Outside V true (E h) (E h) ((n - 1) * E h) X Y W (Datatypes.S h) x y z near m HI O LI) as (p & P & HC & ED & DI).
    { apply LATE. exists i, j, k. rewrite KV. exact LT. }
    exists (cube X Y W (Datatypes.S h)), p. split; [apply (same_cube_child X Y W h i j k); [exact O | repeat split]|]. split; [exact P|].
    assert (level p = 19 - Z.of_nat h) as LP.
    { apply (same_edge p (cube (X + off i h) (Y + off j h) (W + off k h) h)); [apply octants; exact P | apply cube_kid; exact O|]. rewrite cube_edge. lia. }
    split; [exact (HC eq_refl)|]. split; [exact LP|].
    rewrite distance_comm, LP, E_cells. exact DI.
Qed.
End Served.

(** Rules for pairs. *)
Section Stops.
Variables n s : Z.
Hypothesis Hn : 1 <= n <= 4096.
Hypothesis Hs : 0 <= s.

Definition late_rule a b := side_of a = Outside -> edge b < edge a -> 0 < distance a b.
Definition source_rule a b := side_of b = Crossing -> 2 * edge b <= edge a -> (n - 1) * edge b <= distance a b.
Lemma source_stop_right : stop_is_right Cross Outside (source_stop n) source_rule.
Proof.
  intros h g t u d Lh Lg S U _ H x y z x' y' z' a b A B DD SC F. unfold source_stop in H.
  pose proof (proj2 (proj2 (proj2 (flat_inside Outside g u (sized_deep Cross _ _ U) _ _ _ _ B)))) as [PB _].
  pose proof B as B'. apply (flat_size Cross) in B'; [|exact U]. apply (flat_size Cross) in A; [|exact S].
  destruct (sized_most Cross h t Lh S) as [M _]. destruct (sized_most Cross g u Lg U) as [M' _].
  apply orb_prop in H. destruct H as [H|H].
  - exfalso. apply negb_true_iff in H. revert SC. refine (flat_has Cross Outside Crossing eq_refl _ g u U H _ _ _ _ B).
    intros k. destruct k; simpl; congruence.
  - apply Z.leb_le in H. rewrite (sub_small n) in H by (unfold small; lia).
    assert (Z.shiftr (most t (E h)) 1 = most t (E h) / 2) as Q by (rewrite Z.shiftr_div_pow2 by lia; reflexivity). rewrite Q in H. clear Q.
    assert (edge b <= most t (E h) / 2) as G by (apply Z.div_le_lower_bound; lia).
    assert (most t (E h) / 2 <= 524288) by (apply Z.div_le_upper_bound; lia).
    assert (edge b <= Z.min (most u (E g)) (most t (E h) / 2)) as G' by (apply Z.min_glb; lia).
    assert (Z.min (most u (E g)) (most t (E h) / 2) <= 524288) as G'' by lia.
    set (w := Z.min _ _) in *. rewrite mul_small in H by (unfold small; nia). nia.
Qed.

Variable below : Z.
Definition marked_rule a b := apart_enough n below a b /\ late_rule a b /\ source_rule a b.
Lemma marked_skip_right : skip_is_right Cross Outside marked_skip marked_rule.
Proof.
  intros h g t u _ _ S U L x y z x' y' z' a b A B. apply Z.leb_le in L.
  pose proof (proj2 (proj2 (proj2 (flat_inside Outside g u (sized_deep Cross _ _ U) _ _ _ _ B)))) as [PB _].
  pose proof (flat_size Cross Outside h t S _ _ _ _ A). pose proof (flat_size Cross Outside g u U _ _ _ _ B).
  split; [intros F; lia | split; [intros _ F; lia | intros _ F; lia]].
Qed.
Lemma marked_stop_right : stop_is_right Cross Outside (marked_stop n (Z.shiftr 2097152 below)) marked_rule.
Proof.
  intros h g t u d Lh Lg S U D H x y z x' y' z' a b A B DD. unfold marked_stop in H.
  apply andb_prop in H. destruct H as [H H3]. apply andb_prop in H. destruct H as [H1 H2]. split; [|split].
  - exact (graded_stop_right Outside n below Hn h g t u d Lh Lg S U D H1 x y z x' y' z' a b A B DD).
  - intros SO F. apply orb_prop in H2. destruct H2 as [H2|H2]; [apply Z.ltb_lt in H2; lia|].
    pose proof (sources_only_right h t H2 _ _ _ a A). congruence.
  - exact (source_stop_right h g t u d Lh Lg S U D H3 x y z x' y' z' a b A B DD).
Qed.

Definition extra_rule a b := side_of b = Crossing -> s < edge a \/ s <= edge a /\ side_of a = Outside -> 0 < distance a b.
Lemma extra_skip_right : skip_is_right Cross Outside (extra_skip s) extra_rule.
Proof.
  intros h g t u Lh Lg S U H x y z x' y' z' a b A B SC F. exfalso. unfold extra_skip in H.
  pose proof A as A'. apply (flat_size Cross) in A'; [|exact S]. apply orb_prop in H. destruct H as [H|H].
  - assert ((exists k, t = Cube k /\ k = Cross /\ E h <= s) \/ most t (E h) < s) as [(k & -> & -> & L)|L].
    { destruct t as [[]|]; first [left; exists Cross; split; [reflexivity|]; split; [reflexivity|]; apply Z.leb_le; exact H | right; apply Z.ltb_lt; exact H]. }
    + apply flat_cube in A. destruct A as (sd & SD & ->). cbn [side_in side_of] in *. unfold edge in F. cbn [level] in F. rewrite E_cells in F.
      destruct F as [F | [_ F]]; [lia | congruence].
    + lia.
  - apply negb_true_iff in H. revert SC. refine (flat_has Cross Outside Crossing eq_refl _ g u U H _ _ _ _ B).
    intros k. destruct k; simpl; congruence.
Qed.
Lemma extra_stop_right : stop_is_right Cross Outside extra_stop extra_rule.
Proof. intros h g t u d _ _ _ _ _ H x y z x' y' z' a b _ _ DD _ _. apply Z.ltb_lt in H. lia. Qed.
End Stops.

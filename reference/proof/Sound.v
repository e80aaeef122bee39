(** The theorem: what the program accepts is as Statement.v says. *)
From Coq Require Import ZArith List Bool Lia Permutation Relations.
Import ListNotations.
From Proof Require Import Statement Checker Check Octants Reading Pairs Flood Counts Base Unique Least.
Open Scope Z_scope.
Strategy expand [check check_inputs check_full check_base check_crossing check_graded].
Strategy opaque [mark_sources served faces face flood rounds sweeps walk spot mark every overlay fine_tree rim wet look flat deep].

Lemma in_edge_right p : in_edge p = true -> 0 <= p / 256 < 524288.
Proof.
  unfold in_edge. rewrite Z.shiftr_div_pow2 by lia. change (2 ^ 8) with 256. intros H. apply andb_prop in H. rewrite Z.leb_le, Z.ltb_lt in H. exact H.
Qed.

Section Accepted.
Variable c : inputs.
Variable L : list leaf.
Variable t : tree.
Variable h : nat.
Hypothesis H19 : h = 19%nat.
Hypothesis D : deep h t.
Hypothesis LP : Permutation (flat (flow c) h 0 0 0 t) L.
Hypothesis OK : check_base c t = true.
Local Notation s0 := (flow c).
Local Notation kinds := (of_kind c L t h).

Lemma base_parts : faces (kind_of_flow c) 20 t = true /\
  (if has_seeds c then seeds_reached c t && every (fun k => negb (same (kind_of_flow c) k)) t else true) = true /\
  (if may_enclose c then rim Outer t else true) = true.
Proof.
  unfold check_base in OK. apply andb_prop in OK. destruct OK as [A B]. apply andb_prop in A. destruct A as [A A']. auto.
Qed.

Lemma seed_right p q r : has_seeds c = true -> In (p, q, r) (seeds c) ->
  in_root (p / 256) (q / 256) (r / 256) /\ look h 0 0 0 (p / 256) (q / 256) (r / 256) t = Reached.
Proof.
  intros HS S. destruct base_parts as (_ & B & _). rewrite HS in B. apply andb_prop in B. destruct B as [B _].
  unfold seeds_reached in B. rewrite forallb_forall in B. specialize (B (p, q, r) S). cbv beta iota in B.
  apply andb_prop in B. destruct B as [B SP]. apply andb_prop in B. destruct B as [B U3]. apply andb_prop in B. destruct B as [U1 U2].
  apply in_edge_right in U1, U2, U3. apply same_eq in SP.
  assert (forall m, Z.shiftr m 8 = m / 256) as SH by (intros; rewrite Z.shiftr_div_pow2 by lia; reflexivity). rewrite !SH in SP.
  assert (in_root (p / 256) (q / 256) (r / 256)) as IR by (unfold in_root; replace (cells 0) with 524288 by reflexivity; auto).
  split; [exact IR|].
  assert (spot 19 (p / 256) (q / 256) (r / 256) 0 0 0 524288 t = spot h (p / 256) (q / 256) (r / 256) 0 0 0 (E h) t) as Q
    by (rewrite (Eh h H19), H19; reflexivity).
  rewrite Q, (spot_right (kind_of_flow c)) in SP; try lia; try (rewrite (Eh h H19); lia); [symmetry; exact SP | exact D | apply (root_cube h H19); exact IR].
Qed.

Hypothesis TR : true_tree c L t h (started c) (outer c).

Lemma no_seeds_left a k : has_seeds c = true -> kinds a k -> k <> kind_of_flow c.
Proof.
  intros HS (A & S & K) ->. destruct base_parts as (_ & B & _). rewrite HS in B. apply andb_prop in B. destruct B as [_ B].
  pose proof (every_look _ h t D B 0 0 0 (cx a) (cy a) (cz a)) as Q. cbv beta in Q.
  rewrite (K _ _ _ (corner c L t h H19 D LP a A)) in Q. destruct (kind_of_flow c); discriminate.
Qed.

Lemma seeded_right : seeded c L.
Proof.
  intros NS. pose proof (proj2 (has_seeds_right c) NS) as HS.
  assert (forall b, In b L -> seed_in c b -> kinds b Reached) as SEED.
  { intros b B (p & q & r & S & P). destruct (has_kind c L t h D LP b B) as (k & K). pose proof K as (_ & _ & U).
    rewrite <- (proj2 (seed_right p q r HS S)) , (U _ _ _ P). exact K. }
  split; [|split].
  - intros p q r S. apply (seed_right p q r HS S).
  - intros a A S. destruct (SEED a A S) as (_ & Q & _). cbn [side_in] in Q. injection Q as <-. apply s0_crossing.
  - intros a A NC. split.
    + intros F. destruct (has_kind c L t h D LP a A) as (k & K). pose proof (no_seeds_left a k HS K) as N.
      assert (k = Reached) as ->.
      { destruct K as (_ & Q & _). rewrite F in Q. unfold flow, kind_of_flow in *. destruct k, (keep c); cbn [side_in] in Q; congruence. }
      destruct (reached_kind c L t h H19 D LP (started c) (outer c) a TR K) as (b & B & S & C). exists b. split; [exact B|]. split; [|exact C].
      unfold started in S. rewrite HS in S. exact S.
    + intros (b & B & S & C). rewrite (connected_side c L t h H19 D LP OK a b C).
      destruct (SEED b B S) as (_ & Q & _). cbn [side_in] in Q. congruence.
Qed.

Definition far := negb (every (fun k => negb (same Reached k)) t).
Lemma rim_outer b : may_enclose c = true -> at_boundary b -> kinds b Outer -> False.
Proof.
  intros ME B (I & S & K). destruct base_parts as (_ & _ & R). rewrite ME in R.
  destruct (rim_kind s0 Outer t h H19 D b R (proj1 (in_L c L t h LP b) I) B Outer K) as [N | N]; congruence.
Qed.

(** A leaf of T0 is either deleted or filled with leaves of its side. *)
Lemma fate_right a k : kinds a k -> (fate c far k = Empty /\ deleted c L a) \/ (side_in s0 (fate c far k) = Some (side_of a) /\ ~ deleted c L a).
Proof.
  intros K. pose proof K as (A & S & U).
  assert (side_of a <> Outside -> ~ enclosed c L a) as NE by (intros N (_ & _ & _ & Q & _); contradiction).
  assert (keep c <> Keep_outside -> ~ enclosed c L a) as NK by (intros N (Q & _); contradiction).
  destruct k.
  - discriminate.
  - assert (side_of a = Outside) as SO by (cbn [side_in] in S; congruence).
    unfold fate. destruct (keep c) eqn:KC.
    + destruct (may_enclose c && far) eqn:M.
      * left. split; [reflexivity|]. right; right. apply andb_prop in M. destruct M as [ME FAR].
        pose proof (proj1 (may_enclose_right c) ME) as (_ & NS & DE).
        assert (has_seeds c = false) as HS by (unfold has_seeds; rewrite NS; reflexivity).
        split; [exact KC|]. split; [exact NS|]. split; [exact DE|]. split; [exact SO|]. split.
        -- apply negb_true_iff in FAR. destruct (some_look _ h t D FAR 0 0 0) as (u & v & w & P & Q). apply negb_false_iff, same_eq in Q.
           destruct (TR u v w P (eq_sym Q)) as [[_ N] | (a' & b & A' & B & ST & SA & C & _)]; [exfalso; apply N; apply (root_h h H19); exact P|].
           exists b. split; [exact B|]. split.
           ++ rewrite <- (connected_side c L t h H19 D LP OK a' b C), SA. unfold flow. rewrite KC. reflexivity.
           ++ unfold started in ST. rewrite HS in ST. exact ST.
        -- intros (b & B & AB & C). exact (rim_outer b ME AB (connected_kind c L t h H19 D LP OK a b Outer C K)).
      * right. split; [cbn [side_in]; congruence|]. intros [[_ Q] | [[Q _] | Q]]; [congruence | congruence |].
        destruct Q as (_ & NS & DE & _ & (b & B & SB & AB) & _).
        pose proof (proj2 (may_enclose_right c) (conj KC (conj NS DE))) as ME. rewrite ME in M. cbn [andb] in M.
        destruct (has_kind c L t h D LP b B) as (kb & KB). apply negb_false_iff in M.
        pose proof KB as (_ & S' & U'). pose proof (every_look _ h t D M 0 0 0 (cx b) (cy b) (cz b)) as Q. cbv beta in Q.
        rewrite (U' _ _ _ (corner c L t h H19 D LP b B)) in Q.
        assert (kb = Outer) as -> by (rewrite SB in S'; destruct kb; cbn [side_in same negb] in *; congruence).
        exact (rim_outer b ME AB KB).
    + left. split; [reflexivity|]. right; left. auto.
    + right. split; [cbn [side_in]; congruence|]. intros [[Q _] | [[Q _] | (Q & _)]]; congruence.
  - assert (side_of a = Inside) as SO by (cbn [side_in] in S; congruence).
    unfold fate. destruct (keep c) eqn:KC.
    + left. split; [reflexivity|]. left. auto.
    + right. split; [cbn [side_in]; congruence|]. intros [[Q _] | [[_ Q] | (Q & _)]]; congruence.
    + right. split; [cbn [side_in]; congruence|]. intros [[Q _] | [[Q _] | (Q & _)]]; congruence.
  - assert (side_of a = Crossing) as SO by (cbn [side_in] in S; congruence).
    right. split; [cbn [fate side_in]; congruence|]. intros [[_ Q] | [[_ Q] | (_ & _ & _ & Q & _)]]; congruence.
  - right. cbn [side_in] in S. split; [cbn [fate]; rewrite K0; exact S|]. intros [[Q Q'] | [[Q Q'] | Q]].
    + unfold flow in S. rewrite Q in S. congruence.
    + unfold flow in S. rewrite Q in S. congruence.
    + destruct Q as (KC & NS & DE & _ & _ & N). apply N.
      destruct (reached_kind c L t h H19 D LP (started c) (outer c) a TR K) as (b & B & ST & C). exists b. split; [exact B|]. split; [|exact C].
      unfold started, has_seeds in ST. rewrite NS in ST. exact ST.
Qed.

(** The graded mesh. *)
Variables mesh dropped : list leaf.
Variable g : tree.
Hypothesis Dg : deep h g.
Hypothesis GP : Permutation (flat s0 h 0 0 0 g) (mesh ++ dropped).
Hypothesis OV : overlay (fate c far) t g = true.
Lemma fate_empty : fate c far Empty = Empty. Proof. reflexivity. Qed.

Lemma complete_right : tiles L -> complete c L mesh dropped.
Proof.
  intros [_ T] u v w IR. destruct (T u v w IR) as (a & A & P). destruct (has_kind c L t h D LP a A) as (k & K).
  pose proof K as (_ & _ & U). pose proof (overlay_look (fate c far) h t D g 0 0 0 u v w Dg OV) as O. rewrite (U u v w P) in O.
  destruct (fate_right a k K) as [[_ DL] | [S _]]; [right; exists a; auto|]. left.
  rewrite <- O in S. pose proof (proj1 (root_h h H19 u v w) IR) as (PX & PY & PZ).
  destruct (look_flat s0 h g Dg 0 0 0 u v w _ PX PY PZ S) as (o & Q & HO & _). exists o. split; [apply (Permutation_in o GP); exact Q | exact HO].
Qed.

Lemma inherits_right : inherits c L mesh dropped.
Proof.
  intros o O. apply (Permutation_in o (Permutation_sym GP)) in O.
  destruct (overlay_within (fate c far) fate_empty s0 h t D g 0 0 0 o Dg OV O) as (b & B & W); [rewrite fate_empty; discriminate|].
  apply (Permutation_in b LP) in B. exists b. split; [exact B|]. split; [exact W|].
  destruct (has_kind c L t h D LP b B) as (k & K). pose proof K as (_ & _ & U).
  destruct (flat_look s0 h g Dg 0 0 0 o O) as (k' & S' & U').
  assert (holds o (cx o) (cy o) (cz o)) as HC by (apply (flat_inside s0 h g Dg) in O; unfold holds; lia).
  pose proof (overlay_look (fate c far) h t D g 0 0 0 (cx o) (cy o) (cz o) Dg OV) as Q.
  rewrite (U _ _ _ (W _ _ _ HC)), (U' _ _ _ HC) in Q. subst k'.
  destruct (fate_right b k K) as [[F _] | [S N]]; [rewrite F in S'; discriminate|]. split; [congruence | exact N].
Qed.

Lemma linear_right : linear (mesh ++ dropped).
Proof. apply (linear_permutation _ _ GP). apply flat_linear; assumption. Qed.
End Accepted.

(** Crossing leaves are in the mesh, or were deleted after gradation. *)
Lemma crossing_right c mesh dropped m d h : deep h m -> deep h d ->
  (forall s, Permutation (flat s h 0 0 0 m) (leaves mesh)) -> (forall s, Permutation (flat s h 0 0 0 d) (leaves dropped)) ->
  check_crossing c dropped m d = true -> without_crossing c (leaves mesh) (leaves dropped).
Proof.
  intros Dm Dd PM PD H. unfold check_crossing in H. unfold without_crossing. destruct (keep_crossing c).
  - destruct dropped; [reflexivity | discriminate].
  - apply andb_prop in H. destruct H as [HM HD]. split; intros a A.
    + apply (Permutation_in a (Permutation_sym (PM Outside))) in A. destruct (flat_look Outside h m Dm 0 0 0 a A) as (k & S & U).
      apply (flat_inside Outside h m Dm) in A. assert (holds a (cx a) (cy a) (cz a)) as HC by (unfold holds; lia).
      pose proof (every_look _ h m Dm HM 0 0 0 (cx a) (cy a) (cz a)) as Q. cbv beta in Q. rewrite (U _ _ _ HC) in Q.
      destruct k; cbn [side_in same negb] in *; congruence.
    + apply (Permutation_in a (Permutation_sym (PD Outside))) in A. destruct (flat_look Outside h d Dd 0 0 0 a A) as (k & S & U).
      apply (flat_inside Outside h d Dd) in A. assert (holds a (cx a) (cy a) (cz a)) as HC by (unfold holds; lia).
      pose proof (every_look _ h d Dd HD 0 0 0 (cx a) (cy a) (cz a)) as Q. cbv beta in Q. rewrite (U _ _ _ HC) in Q.
      destruct k; cbn [side_in same orb] in *; congruence.
Qed.

Lemma surface_edge n : 0 <= n <= 19 -> Z.shiftr 524288 n = cells n.
Proof.
  intros. rewrite Z.shiftr_div_pow2 by lia. change 524288 with (2 ^ 19). rewrite <- Z.pow_sub_r by lia. reflexivity.
Qed.

Theorem check_sound c base mesh dropped of_base of_mesh :
  check c base mesh dropped of_base of_mesh = true -> promised c base mesh dropped of_base of_mesh.
Proof.
  unfold check. intros H.
  destruct (check_inputs c) eqn:CI; [|discriminate].
  destruct (build (kind_of_flow c) base) as [t0|] eqn:BT; [|discriminate].
  destruct (check_counts of_base base t0 && check_full c t0) eqn:C1; [|discriminate]. cbv zeta in H.
  destruct (build Cross mesh) as [m|] eqn:BM; [|discriminate].
  destruct (check_counts of_mesh mesh m) eqn:C2; [|discriminate].
  destruct (build Cross dropped) as [d|] eqn:BD; [|discriminate].
  destruct (check_crossing c dropped m d) eqn:CC; [|discriminate].
  destruct (merge Cross m d 524288) as [g|] eqn:MG; [|discriminate].
  pose proof (rest_right _ _ _ _ H) as REST. cbv beta in REST. apply andb_prop in REST. destruct REST as [CB OV].
  unfold check_inputs in CI. apply andb_prop in CI. destruct CI as [CI I4]. apply andb_prop in CI. destruct CI as [CI I3].
  apply andb_prop in CI. destruct CI as [I1 I2]. rewrite Z.leb_le in I1, I2, I3, I4.
  apply andb_prop in C1. destruct C1 as [C1 CF]. unfold check_full in CF. apply andb_prop in CF. destruct CF as [DRY FINE].
  rewrite surface_edge in FINE by lia.
  assert (forall k parts t, build k parts = Some t -> forall s, Permutation (flat s 19 0 0 0 t) (leaves parts)) as PB
    by (intros k parts t B s; apply (build_right k s) in B; apply B).
  pose proof (PB _ _ _ BT) as PT. pose proof (PB _ _ _ BM) as PM. pose proof (PB _ _ _ BD) as PD. clear PB.
  apply (build_right _ Outside) in BT, BM, BD. destruct BT as (WT & ST & _), BM as (WM & SM & _), BD as (WD & SD & _).
  apply (counts_right _ _ _ _ ST PT) in C1. apply (counts_right _ _ _ _ SM PM) in C2.
  rewrite <- E_root in MG.
  destruct (merge_right Cross (flow c) 19 m (sized_deep _ _ _ SM) d g (le_n 19) SM SD MG) as [SG PG]. specialize (PG 0 0 0).
  rewrite (PM (flow c)), (PD (flow c)) in PG.
  destruct (merge_right Cross Outside 19 m (sized_deep _ _ _ SM) d g (le_n 19) SM SD MG) as [_ PO]. specialize (PO 0 0 0).
  rewrite (PM Outside), (PD Outside) in PO.
  assert (fine c (leaves base)) as FN.
  { intros a A S. apply (Permutation_in a (Permutation_sym (PT (flow c)))) in A. rewrite <- E_root in FINE.
    pose proof (fine_right _ (flow c) _ (s0_crossing c) 19 t0 ST FINE 0 0 0 a A S) as Q.
    apply (flat_inside _ 19 t0 (sized_deep _ _ _ ST)) in A. unfold edge, cells in Q.
    destruct (Z_le_dec (surface c) (level a)) as [|N]; [assumption|]. exfalso.
    assert (2 ^ (19 - surface c) < 2 ^ (19 - level a)) by (apply Z.pow_lt_mono_r; lia). lia. }
  clear FINE.
  assert (exists h, h = 19%nat) as (h & H19) by (exists 19%nat; reflexivity). rewrite <- H19 in *.
  pose proof (sized_deep _ _ _ ST) as DT. rename PG into GP.
  assert (Permutation (flat (flow c) h 0 0 0 g) (leaves mesh ++ leaves dropped)) as GP' by exact GP.
  pose proof (sized_deep _ _ _ SG) as DG.
  assert (has_seeds c = true -> forall p q r, In (p, q, r) (seeds c) -> in_root (p / 256) (q / 256) (r / 256)) as IR.
  { intros HS p q r S. destruct (base_parts c _ CB) as (_ & B & _). rewrite HS in B. apply andb_prop in B. destruct B as [B _].
    unfold seeds_reached in B. rewrite forallb_forall in B. specialize (B (p, q, r) S). cbv beta iota in B.
    apply andb_prop in B. destruct B as [B _]. apply andb_prop in B. destruct B as [B U3]. apply andb_prop in B. destruct B as [U1 U2].
    apply in_edge_right in U1, U2, U3. unfold in_root. replace (cells 0) with 524288 by reflexivity. auto. }
  pose proof (flooded_right c base h H19 t0 DT (PT (flow c)) DRY IR) as [[DF TF] FF].
  assert (Permutation (flat (flow c) h 0 0 0 (flooded c t0)) (leaves base)) as LP by (rewrite FF; apply PT).
  pose proof (base_tiles c base h H19 t0 DT (PT (flow c)) DRY) as TI.
  pose proof (linear_right c h H19 _ _ g DG GP') as LI.
  pose proof (complete_right c _ _ h H19 DF LP CB TF _ _ g DG GP' OV TI) as CO.
  pose proof (inherits_right c _ _ h H19 DF LP CB TF _ _ g DG GP' OV) as INH.
  assert (region c (leaves base) (leaves mesh) (leaves dropped)) as RG by (split; [exact TI | split; [exact LI | split; [exact CO | exact INH]]]).
  assert (Statement.least c (leaves base) (leaves mesh) (leaves dropped) /\ layers c (leaves mesh) (leaves dropped)) as [LEAST LAYERS].
  { clear GP GP' DG. rewrite H19 in *.
    assert (forall b, In b (flat (flow c) 19 0 0 0 (flooded c t0)) <-> In b (leaves base)) as LB
      by (intros b; split; [apply (Permutation_in b LP) | apply (Permutation_in b (Permutation_sym LP))]).
    assert (forall a, In a (flat Outside 19 0 0 0 g) <-> In a (leaves mesh ++ leaves dropped)) as LG
      by (intros a; split; [apply (Permutation_in a PO) | apply (Permutation_in a (Permutation_sym PO))]).
    split; [exact (gradation_least c _ _ _ RG (conj I3 I4) (conj I1 I2) _ g (flow c) (fate c _) (fate_empty c _) DF LB SG LG OV _ H) |
            exact (layers_right c _ _ _ RG (conj I3 I4) (conj I1 I2) _ g (flow c) (fate c _) (fate_empty c _) DF LB SG LG OV _ H)]. }
  split. { apply Forall_app. split; [exact WT|]. apply Forall_app. auto. }
  split; [exact C1|]. split; [exact C2|]. cbv zeta. split; [exact TI|]. split; [exact FN|].
  split; [intros a b C; exact (connected_side c _ _ h H19 DF LP CB a b C)|].
  split; [exact (seeded_right c _ _ h H19 DF LP CB TF)|].
  split; [exact LI|].
  split; [exact (crossing_right c mesh dropped m d h (sized_deep _ _ _ SM) (sized_deep _ _ _ SD) PM PD CC)|].
  auto.
Qed.
(** Two accepted meshes of one T0 and one case have the same leaves, in whatever parts. *)
Corollary accepted_equal c base m d m' d' of_base of_m of_m' :
  check c base m d of_base of_m = true -> check c base m' d' of_base of_m' = true -> Permutation (leaves m) (leaves m').
Proof. intros A B. exact (promised_equal c base m d m' d' _ _ _ (check_sound _ _ _ _ _ _ A) (check_sound _ _ _ _ _ _ B)). Qed.
Print Assumptions accepted_equal.
